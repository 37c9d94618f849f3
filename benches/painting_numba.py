"""The ellipses of painting.rs, painted by numba on one thread and on several: rows of the map in parallel, ellipses in order.

Prints one line per number of threads: the threads and the median time of a frame in milliseconds.
usage: painting_numba.py [THREADS ...]
"""
import math
import statistics
import sys
import time

import numba
import numpy as np

SIDE_PX, ELLIPSES, SEMI_AXIS_PX, ASPECT = 1024, 300, 24.0, 0.66


def ellipses():
    """Middle x and y, angle and scale of each; the same numbers as in painting.rs."""
    state = 7

    def following():
        nonlocal state
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        return (state >> 40) / 2**24

    rows = [[following() for _ in range(4)] for _ in range(ELLIPSES)]
    span = SIDE_PX - 120.0
    return np.array([[60 + x * span, 60 + y * span, a * math.pi, 0.8 + 0.4 * s] for x, y, a, s in rows], np.float32)


@numba.njit(parallel=True, fastmath=True)
def paint(texels, ellipses, bands):
    height = texels.shape[0] // bands
    for band in numba.prange(bands):
        top, bottom = band * height, (band + 1) * height
        for k in range(ellipses.shape[0]):
            middle_x, middle_y, angle, scale = ellipses[k]
            cos, sin = math.cos(angle), math.sin(angle)
            a, b = np.float32(SEMI_AXIS_PX) * scale, np.float32(SEMI_AXIS_PX * ASPECT) * scale
            # Half of the box round the ellipse.
            half_x, half_y = math.hypot(a * cos, b * sin), math.hypot(a * sin, b * cos)
            left, right = int(math.ceil(middle_x - half_x - 0.5)), int(math.floor(middle_x + half_x - 0.5)) + 1
            first, last = int(math.ceil(middle_y - half_y - 0.5)), int(math.floor(middle_y + half_y - 0.5)) + 1
            for y in range(max(first, top), min(last, bottom)):
                dy = np.float32(y + 0.5) - middle_y
                for x in range(left, right):
                    dx = np.float32(x + 0.5) - middle_x
                    along, across = (cos * dx + sin * dy) / a, (cos * dy - sin * dx) / b
                    rest = np.float32(1.0) - along * along - across * across
                    if rest > 0:
                        alpha = rest * rest * np.float32(0.5)
                        keep = np.float32(1.0) - alpha
                        texels[y, x, 0] = np.uint8(texels[y, x, 0] * keep + np.float32(180.0) * alpha)
                        texels[y, x, 1] = np.uint8(texels[y, x, 1] * keep)
                        texels[y, x, 2] = np.uint8(texels[y, x, 2] * keep)
                        texels[y, x, 3] = np.uint8(texels[y, x, 3] * keep + np.float32(255.0) * alpha)


def median_ms(texels, painted, seconds=1.0):
    times = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 30:
        start = time.perf_counter()
        paint(texels, painted, 16)
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)


def main():
    texels = np.zeros((SIDE_PX, SIDE_PX, 4), np.uint8)
    painted = ellipses()
    paint(texels, painted, 16)
    for threads in [int(argument) for argument in sys.argv[1:]] or [1, 4]:
        numba.set_num_threads(threads)
        print(threads, f"{median_ms(texels, painted):.4f}", flush=True)


if __name__ == "__main__":
    main()
