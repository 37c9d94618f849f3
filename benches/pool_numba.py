"""The step of pool.rs as one would write it with numba: velocity, pressure and two dyes in the middles of 800 x 600 cells, no
walls inside, semi-Lagrangian with clamped bilinear interpolation, ten rounds of Jacobi's iteration from 0.

Prints one line per number of threads: the threads and the median time of a step in milliseconds.
usage: pool_numba.py [THREADS ...]
"""
import statistics
import sys
import time

import numba
import numpy as np

WIDTH, HEIGHT, ROUNDS = 800, 600, 10
HALF, QUARTER, ONE, ZERO = (np.float32(value) for value in (0.5, 0.25, 1.0, 0.0))


@numba.njit(inline="always")
def corner(x, y, u, v, width, height):
    """The cell below and left of where the flow comes from, and the shares of the ones right and above."""
    from_x = min(max(np.float32(x) - u, ZERO), np.float32(width) - np.float32(1.001))
    from_y = min(max(np.float32(y) - v, ZERO), np.float32(height) - np.float32(1.001))
    column, row = int(from_x), int(from_y)
    return column, row, from_x - np.float32(column), from_y - np.float32(row)


@numba.njit(parallel=True, fastmath=True)
def carry_velocity(u, v, next_u, next_v):
    height, width = u.shape
    for y in numba.prange(height):
        for x in range(width):
            column, row, a, b = corner(x, y, u[y, x], v[y, x], width, height)
            for field, out in ((u, next_u), (v, next_v)):
                low = field[row, column] * (ONE - a) + field[row, column + 1] * a
                high = field[row + 1, column] * (ONE - a) + field[row + 1, column + 1] * a
                out[y, x] = low * (ONE - b) + high * b


@numba.njit(parallel=True, fastmath=True)
def carry_dyes(u, v, dyes, following):
    height, width, count = dyes.shape
    for y in numba.prange(height):
        for x in range(width):
            column, row, a, b = corner(x, y, u[y, x], v[y, x], width, height)
            for k in range(count):
                low = dyes[row, column, k] * (ONE - a) + dyes[row, column + 1, k] * a
                high = dyes[row + 1, column, k] * (ONE - a) + dyes[row + 1, column + 1, k] * a
                following[y, x, k] = low * (ONE - b) + high * b


@numba.njit(parallel=True, fastmath=True)
def find_divergence(u, v, divergence):
    height, width = u.shape
    for y in numba.prange(1, height - 1):
        for x in range(1, width - 1):
            divergence[y, x] = HALF * (u[y, x + 1] - u[y, x - 1] + v[y + 1, x] - v[y - 1, x])


@numba.njit(parallel=True, fastmath=True)
def relax(pressure, following, divergence):
    height, width = pressure.shape
    for y in numba.prange(1, height - 1):
        for x in range(1, width - 1):
            around = pressure[y, x - 1] + pressure[y, x + 1] + pressure[y - 1, x] + pressure[y + 1, x]
            following[y, x] = QUARTER * (around - divergence[y, x])


@numba.njit(parallel=True, fastmath=True)
def subtract_gradient(u, v, pressure):
    height, width = u.shape
    for y in numba.prange(1, height - 1):
        for x in range(1, width - 1):
            u[y, x] -= HALF * (pressure[y, x + 1] - pressure[y, x - 1])
            v[y, x] -= HALF * (pressure[y + 1, x] - pressure[y - 1, x])


class Pool:
    def __init__(self):
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
        self.velocity = [np.sin(y / 40).astype(np.float32) * 3, np.cos(x / 50).astype(np.float32) * 3]
        self.carried = [np.zeros_like(field) for field in self.velocity]
        self.dyes = np.random.default_rng(7).random((HEIGHT, WIDTH, 2), np.float32)
        self.next_dyes = np.zeros_like(self.dyes)
        self.divergence, self.pressure, self.next_pressure = (np.zeros_like(self.velocity[0]) for _ in range(3))

    def step(self):
        carry_velocity(*self.velocity, *self.carried)
        self.velocity, self.carried = self.carried, self.velocity
        find_divergence(*self.velocity, self.divergence)
        self.pressure.fill(0)
        for _ in range(ROUNDS):
            relax(self.pressure, self.next_pressure, self.divergence)
            self.pressure, self.next_pressure = self.next_pressure, self.pressure
        subtract_gradient(*self.velocity, self.pressure)
        carry_dyes(*self.velocity, self.dyes, self.next_dyes)
        self.dyes, self.next_dyes = self.next_dyes, self.dyes


def median_ms(seconds=1.0):
    # Anew each time: the flow calms down, and calm flow is read from nearer by.
    pool = Pool()
    times = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 30:
        start = time.perf_counter()
        pool.step()
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)


def main():
    Pool().step()
    for threads in [int(argument) for argument in sys.argv[1:]] or [1, 4]:
        numba.set_num_threads(threads)
        print(threads, f"{median_ms():.4f}", flush=True)


if __name__ == "__main__":
    main()
