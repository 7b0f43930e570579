#!/usr/bin/env python3
"""Writes the pictures that the comparison's py/aruco.py measures detectors on, so that `bench` sees the same ones.

    tags.py PATH/py/aruco.py OUT        OUT/aruco_4x4_50/NNN.pgm and .txt (id, then x y of four corners), OUT/tag36h11/...
"""
import pathlib
import sys

import cv2

script, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
sys.path.insert(0, str(script.parent))
source = script.read_text()
names = {}
exec(source[: source.index("def run(")], names)  # the generator with its seed, without the measurement
for folder, family in (("aruco_4x4_50", cv2.aruco.DICT_4X4_50), ("tag36h11", cv2.aruco.DICT_APRILTAG_36h11)):
    (out / folder).mkdir(parents=True, exist_ok=True)
    for k, (picture, corners) in enumerate(names["synth"](cv2.aruco.getPredefinedDictionary(family))):
        cv2.imwrite(str(out / folder / f"{k:03}.pgm"), picture)
        lines = (f"{tag} " + " ".join(f"{v:.9g}" for v in places.ravel()) for tag, places in corners.items())
        (out / folder / f"{k:03}.txt").write_text("".join(line + "\n" for line in lines))
