"""The same work by OpenCV, SciPy and OpenCAMLib, timed by `cargo bench --bench compensation`.

usage: peers.py opencv HEIGHTS.npy RADIUS...     ns a sample of a dilation by a flat disc
       peers.py scipy HEIGHTS.npy RADIUS         ns a sample of a grey dilation by a ball
       peers.py opencamlib SCREENMILL MESH.stl   cutter locations a CPU second, theirs and ours

One thread, processor time. Lines that start with `missing` say which package is not there.
"""

import resource
import subprocess
import sys
import tempfile
import time

import numpy


def seconds(run, least=1):
    times = []
    for _ in range(least):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


def disc(radius):
    d = numpy.arange(-radius, radius + 1)
    return d[:, None] ** 2 + d[None, :] ** 2 <= radius**2


def opencv(path, radii):
    import cv2

    cv2.setNumThreads(1)
    heights = numpy.load(path)
    for radius in map(int, radii):
        # Its cost does not depend on the surface: a part is enough where a tap is slow.
        part = numpy.ascontiguousarray(heights[: max(2 * radius, 60_000_000 // radius**2 // 100)])
        kernel = disc(radius).astype(numpy.uint8)
        print(radius, 1e9 * seconds(lambda: cv2.dilate(part, kernel), 2) / part.size)


def scipy(path, radius):
    from scipy import ndimage

    radius = int(radius)
    part = numpy.load(path)[:192, :192]
    d = numpy.arange(-radius, radius + 1)
    under = radius**2 - d[:, None] ** 2 - d[None, :] ** 2
    ball = numpy.where(under >= 0, numpy.sqrt(numpy.maximum(under, 0)) - radius, -1e9) * 0.01
    run = lambda: ndimage.grey_dilation(part, footprint=under >= 0, structure=ball)
    print(radius, 1e9 * seconds(run) / part.size)


def opencamlib(binary, path):
    import opencamlib as ocl

    step = 0.01
    data = open(path, "rb").read()
    count = int.from_bytes(data[80:84], "little")
    record = numpy.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("spare", "<u2")])
    corners = numpy.frombuffer(data, record, count, 84)["corner"].astype(float)
    corners[:, :, :2] -= corners.reshape(-1, 3)[:, :2].min(axis=0)
    width, height = corners.reshape(-1, 3)[:, :2].max(axis=0)
    surface = ocl.STLSurf()
    for triangle in corners:
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*corner) for corner in triangle)))
    cutter = ocl.BallCutter(0.5, 100.0)
    drop = ocl.PathDropCutter()
    drop.setSTL(surface)
    drop.setCutter(cutter)
    drop.setSampling(step)
    drop.setZ(-1000.0)
    rows = 12
    points = 0
    start = time.process_time()
    for k in range(rows):
        y = (k + 0.5) * height / rows
        path_ = ocl.Path()
        path_.append(ocl.Line(ocl.Point(0.5 * step, y, 0), ocl.Point(width - 0.5 * step, y, 0)))
        drop.setPath(path_)
        drop.run()
        points += len(drop.getCLPoints())
    theirs = points / (time.process_time() - start)
    with tempfile.TemporaryDirectory() as scratch:
        start = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [binary, "compensate", path, "--cutter", "ball:0.5", "--cl", scratch + "/cl.npy"]
        subprocess.run(command + ["--threads", "1", "--quiet"], check=True, stdout=subprocess.DEVNULL)
        end = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = end.ru_utime + end.ru_stime - start.ru_utime - start.ru_stime
        positions = numpy.load(scratch + "/cl.npy", mmap_mode="r").size
    print(theirs, positions / spent)


try:
    {"opencv": lambda a: opencv(a[0], a[1:]), "scipy": lambda a: scipy(*a), "opencamlib": lambda a: opencamlib(*a)}[
        sys.argv[1]
    ](sys.argv[2:])
except ImportError as error:
    print("missing", error.name)
