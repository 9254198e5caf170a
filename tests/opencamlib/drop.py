"""Drops cutters on a mesh with OpenCAMLib at the positions of `screenmill compensate` files.

usage: drop.py MESH.stl STEP_MM EVERY CUTTER EXACT.npy SAMPLED.npy [CUTTER EXACT.npy SAMPLED.npy ...]

Prints one line a cutter: its positions, by how much EXACT lies below the drop at most, and by how
much above the higher of SAMPLED and the drop at most, both in um, and then how far SAMPLED lies
below the drop at most. Rows of the files are rows 0, EVERY, 2 EVERY, ... of samples.
"""

import sys

import numpy
import opencamlib as ocl


def mesh(path):
    data = open(path, "rb").read()
    count = int.from_bytes(data[80:84], "little")
    record = numpy.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("spare", "<u2")])
    corners = numpy.frombuffer(data, record, count, 84)["corner"].astype(float)
    corners[:, :, :2] -= corners.reshape(-1, 3)[:, :2].min(axis=0)
    surface = ocl.STLSurf()
    for triangle in corners:
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*corner) for corner in triangle)))
    return surface


def cutter(text):
    name, *numbers = text.split(":")
    numbers = [float(number) for number in numbers]
    length = 100.0
    if name == "ball":
        return ocl.BallCutter(numbers[0], length)
    if name == "flat":
        return ocl.CylCutter(numbers[0], length)
    if name == "bull":
        return ocl.BullCutter(numbers[0], numbers[1], length)
    # Its cones are not asked: their drop misses contacts on edges, by 0.12 um here.
    raise SystemExit(f"{text}: no such cutter")


def main():
    path, step, every = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
    surface = mesh(path)
    for text, exact, sampled in zip(*[iter(sys.argv[4:])] * 3):
        exact, sampled = numpy.load(exact).astype(float), numpy.load(sampled).astype(float)
        drop = ocl.BatchDropCutter()
        drop.setSTL(surface)
        # OpenCAMLib keeps a pointer: the cutter must live as long as the drop.
        shape = cutter(text)
        drop.setCutter(shape)
        for k in range(exact.shape[0]):
            y = (k * every + 0.5) * step
            for i in range(exact.shape[1]):
                drop.appendPoint(ocl.CLPoint((i + 0.5) * step, y, -1000.0))
        drop.run()
        z = numpy.array([point.z for point in drop.getCLPoints()]).reshape(exact.shape)
        below = (z - exact).max() * 1000
        above = (exact - numpy.maximum(sampled, z)).max() * 1000
        print(text, z.size, f"{below:.4f} {above:.4f} {(z - sampled).max() * 1000:.4f}")


main()
