#!/usr/bin/env python3
"""Corner errors of OpenCV's and AprilTag's detectors on simulated recordings, in the form of `marker-corners`.

    pip install numpy opencv-contrib-python-headless pupil-apriltags
    python tests/compare/markers.py RECORDING...

Truth: the corners of board.json projected with truth/poses.json. AprilTag's corners are brought to our convention
(minus 0.5 px, turned by half a turn, see the board format). A corner farther than 3 px from its place counts as wrong.
"""
import json
import pathlib
import sys
import time

import cv2
import numpy as np

FAMILIES = {
    "aruco_4x4_50": cv2.aruco.DICT_4X4_50,
    "aruco_5x5_100": cv2.aruco.DICT_5X5_100,
    "aruco_6x6_250": cv2.aruco.DICT_6X6_250,
    "aruco_original": cv2.aruco.DICT_ARUCO_ORIGINAL,
    "tag36h11": cv2.aruco.DICT_APRILTAG_36h11,
}


def opencv(family, refinement):
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = refinement
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(FAMILIES[family]), parameters)

    def detect(grey):
        corners, ids, _ = detector.detectMarkers(grey)
        return [] if ids is None else [(int(i), c.reshape(4, 2).astype(float)) for i, c in zip(ids.ravel(), corners)]

    return detect


def apriltag():
    from pupil_apriltags import Detector

    detector = Detector(families="tag36h11", nthreads=1, quad_decimate=1.0)

    def detect(grey):
        return [(d.tag_id, np.asarray(d.corners)[[1, 0, 3, 2]] - 0.5) for d in detector.detect(grey)]

    return detect


def detectors(family):
    named = {
        "opencv none": opencv(family, cv2.aruco.CORNER_REFINE_NONE),
        "opencv subpix": opencv(family, cv2.aruco.CORNER_REFINE_SUBPIX),
        "opencv contour": opencv(family, cv2.aruco.CORNER_REFINE_CONTOUR),
        "opencv apriltag-0.5": lambda grey: [
            (i, c - 0.5) for i, c in opencv(family, cv2.aruco.CORNER_REFINE_APRILTAG)(grey)
        ],
    }
    if family == "tag36h11":
        named["pupil-apriltags"] = apriltag()
    return named


def project(camera, camera_from_world, points):
    p = camera_from_world[:3, :3] @ points.T + camera_from_world[:3, 3:]
    k = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    pixels, _ = cv2.projectPoints(p.T.copy(), np.zeros(3), np.zeros(3), k, np.array(camera["distortion"], float))
    return pixels.reshape(-1, 2)


def views(recording):
    if "views" in recording:
        return [v["frames"][len(v["frames"]) // 2]["color"] for v in recording["views"]]
    return [f["color"] for f in recording["frames"]]


def measure(folder):
    recording = json.loads((folder / "recording.json").read_text())
    board = json.loads((folder / "board.json").read_text())
    truth = json.loads((folder / "truth/poses.json").read_text())["views"]
    tags = {t["id"]: np.array(t["corners_m"], float) for t in board["tags"]}
    pictures = [cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE) for name in views(recording)]
    poses = [np.linalg.inv(np.array(v["world_from_camera"]).reshape(4, 4)) for v in truth]
    for name, detect in detectors(board["family"]).items():
        errors, wrong, times = [], 0, []
        for grey, pose in zip(pictures, poses):
            start = time.perf_counter()
            found = detect(grey)
            times.append(1e3 * (time.perf_counter() - start))
            for tag, corners in found:
                off = corners - project(recording["color"], pose, tags[tag]) if tag in tags else None
                if off is None or np.linalg.norm(off, axis=1).max() > 3:
                    wrong += 1
                else:
                    errors.extend(off)
        errors = np.array(errors).reshape(-1, 2)
        lengths = np.linalg.norm(errors, axis=1)
        bias = errors.mean(axis=0) if len(errors) else (np.nan, np.nan)
        print(
            f"{folder.name:<26} {name:<20} {len(errors) // 4:>4} {wrong:>5} {np.median(lengths):>8.3f} "
            f"{np.sqrt((lengths**2).mean()):>8.3f} {bias[0]:>+5.2f},{bias[1]:>+5.2f} {np.median(times):>7.1f}"
        )


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    cv2.setNumThreads(1)
    print(f"{'recording':<26} {'detector':<20} {'found':>4} {'wrong':>5} {'median':>8} {'rms':>8} {'bias x,y':>11} {'ms':>7}")
    for folder in sys.argv[1:]:
        measure(pathlib.Path(folder))


if __name__ == "__main__":
    main()
