#!/usr/bin/env python3
"""How many mutual matches of Open3D's features are right on the comparison's pairs, as `bench` counts its own.

    COMPARE_DATA=... features.py [PAIRS]        one CSV line in the comparison's columns
"""
import os
import pathlib
import sys
import time

import numpy as np
import open3d as o3d

data = pathlib.Path(os.environ["COMPARE_DATA"])
count = int(sys.argv[1]) if len(sys.argv) > 1 else 64
RIGHT = 0.0075
registration = o3d.pipelines.registration
right, matches, wall, cpu = [], [], [], []
for k in range(count):
    base = str(data / f"pairs/p{k:03d}")
    truth = np.loadtxt(base + "_gt.txt")
    clouds = [o3d.io.read_point_cloud(f"{base}_{end}5.pcd") for end in ("src", "tgt")]
    origins = [np.loadtxt(base + "_srcorigin.txt"), np.zeros(3)]
    features = []
    for cloud, origin in zip(clouds, origins):
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
        cloud.orient_normals_towards_camera_location(origin)
        features.append(
            registration.compute_fpfh_feature(cloud, o3d.geometry.KDTreeSearchParamHybrid(0.025, 100))
        )
    started = time.perf_counter(), time.process_time()
    pairs = np.asarray(registration.correspondences_from_features(*features, True))
    wall.append((time.perf_counter() - started[0]) * 1e3)
    cpu.append((time.process_time() - started[1]) * 1e3)
    source, target = (np.asarray(cloud.points) for cloud in clouds)
    moved = source[pairs[:, 0]] @ truth[:3, :3].T + truth[:3, 3]
    right.append(int((np.linalg.norm(moved - target[pairs[:, 1]], axis=1) <= RIGHT).sum()))
    matches.append(len(pairs))
print(
    f"Open3D-{o3d.__version__},feature matching mutual,1,{count},{np.median(wall):.3f},{min(wall):.3f},"
    f"{max(wall):.3f},{np.median(cpu):.3f},0,pairs={count} right_total={sum(right)} right_med={np.median(right)} "
    f"matches_med={np.median(matches)}",
    flush=True,
)
