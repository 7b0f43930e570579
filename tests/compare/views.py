#!/usr/bin/env python3
"""Eight views to a surface: `scan-product build` on the peers' own views, from files to files, judged by the peers' own score().

Usage: views.py PROGRAM [THREADS]   in the folder of the comparison; prints the peers' CSV lines.
With several threads, runs on one thread take turns with them.
"""
import json
import os
import subprocess
import sys
import time

sys.path.insert(0, "py")
import open3d as o3d
from common import *

PROGRAM = sys.argv[1]
THREADS = int(sys.argv[2]) if len(sys.argv) > 2 else 1
VIEWS, RUNS, UNITS_PER_METRE = 8, 5, 20000
CAMERA = dict(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5, distortion=[0.0] * 5)


def write_image(path, pixels):
    if not o3d.io.write_image(path, o3d.geometry.Image(pixels)):
        sys.exit(f"{path} could not be written")


def write_recording(views, folder):
    """The peers' depth pictures as a recording; they have no colours."""
    for part in ("color", "depth"):
        os.makedirs(f"{folder}/{part}", exist_ok=True)
    write_image(f"{folder}/color/gray.png", np.full((480, 640, 3), 128, np.uint8))
    listed = []
    for i in range(VIEWS):
        metres = np.nan_to_num(np.load(f"{views}/depth{i}.npy"))
        write_image(f"{folder}/depth/{i}.png", np.round(metres * UNITS_PER_METRE).astype(np.uint16))
        frame = dict(color="color/gray.png", depth=f"depth/{i}.png", timestamp_nanos=0)
        listed.append(dict(name=f"{i:03d}", frames=[frame]))
    recording = dict(
        version=1,
        device=dict(backend="import", serial=""),
        color=CAMERA,
        depth=dict(CAMERA, units_per_metre=float(UNITS_PER_METRE)),
        color_from_depth=np.eye(4).ravel().tolist(),
        views=listed,
    )
    with open(f"{folder}/recording.json", "w") as file:
        json.dump(recording, file)


def build(folder, out, threads=THREADS):
    """Milliseconds of wall and processor time of one run, and its largest memory in megabytes."""
    command = [PROGRAM, "build", folder, "--no-board", "--out", out]
    began = time.perf_counter()
    quiet = dict(stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    process = subprocess.Popen(command, env=dict(os.environ, RAYON_NUM_THREADS=str(threads)), **quiet)
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - began
    if os.waitstatus_to_exitcode(status) != 0:
        sys.exit(f"{folder} could not be built")
    return wall * 1e3, (usage.ru_utime + usage.ru_stime) * 1e3, usage.ru_maxrss // 1024


def peers_score():
    """score() of the peers' own script, so that both are judged by the same lines."""
    source = open("py/o3d_recon.py").read()
    return "def score" + source.split("def score")[1].split("\nrr=")[0]


for obj in ("bunny", "rabbit", "ape", "horse"):
    B = f"{D}syn/{obj}/"
    GT = np.loadtxt(B + "poses.txt").reshape(-1, 4, 4)
    exec(peers_score())
    folder, out = f"views/{obj}", f"views/{obj}-built"
    write_recording(B, folder)
    alone, times = [], []
    for _ in range(RUNS):
        if THREADS > 1:
            alone.append(build(folder, out, 1)[0])
        times.append(build(folder, out))
    times = np.array(times)
    one_thread = f" one_thread_min={min(alone):.0f}" if alone else ""
    poses = [np.array(view["world_from_camera"]).reshape(4, 4) for view in json.load(open(f"{out}/report.json"))["views"]]
    middle = [np.asarray(o3d.io.read_point_cloud(f"{B}view{i}.pcd").points).mean(0) for i in range(VIEWS)]
    errors = [err(poses[i], np.linalg.inv(GT[0]) @ GT[i], middle[i]) for i in range(1, VIEWS)]
    turned, moved = [e[0] for e in errors], [e[1] for e in errors]
    wall, cpu, peak = times[:, 0], times[:, 1], int(times[:, 2].max())
    quality = score(o3d.io.read_triangle_mesh(f"{out}/model.ply"), GT[0])
    print(
        f"allround,8-view build {obj},{THREADS},{RUNS},{np.median(wall):.1f},{wall.min():.1f},{wall.max():.1f},{np.median(cpu):.1f},{peak},"
        f"cpu_min={cpu.min():.0f} wall_min={wall.min():.0f} pose_rot_mean={np.mean(turned):.3f} max={np.max(turned):.3f}deg "
        f"pose_t_mean={np.mean(moved):.2f} max={np.max(moved):.2f}mm {quality}{one_thread}",
        flush=True,
    )
