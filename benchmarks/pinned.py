"""Draws docs/pinned.png: a robot that pushes obliquely against a wall, in the plane and in three dimensions."""

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Circle, Rectangle

from epuckhebb.gym import TMaze
from epuckhebb.tmaze.robot import EPUCK, STEP_S

FREE, STEPS = 250, 900  # steps of driving ahead, and in all
NAMES = {"pymunk": ("physics=pymunk, in the plane", "tab:orange"), "ode": ("physics=ode, in 3-D", "tab:blue")}
EVERY = ["lifetime.noise=0", "lifetime.gain_rad_s=4", "lifetime.duration_s=60"]


def driven(physics, left, right):
    """(STEPS, 3) x, y [m], heading [rad] of a robot that drives ahead to the far wall, then with these outputs."""
    env = TMaze("base", overrides=[f"physics={physics}", *EVERY])
    env.reset(seed=0, options={"side": "left", "key": 1})
    poses = []
    for step in range(STEPS):
        env.step(np.array([1.0, 1.0] if step < FREE else [left, right]))
        poses.append(env.session.pose)
    return np.array(poses), env.world.boxes


def main():
    figure, (plan, turn) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for physics, (label, colour) in NAMES.items():
        poses, boxes = driven(physics, 0.9, 0.6)
        plan.plot(*poses[:, :2].T, color=colour, label=label)
        plan.add_patch(Circle(poses[-1, :2], EPUCK.radius_m, fill=False, color=colour, lw=1.5))
        time = np.arange(1, STEPS + 1) * STEP_S
        turn.plot(time, np.degrees(poses[:, 2]), color=colour, label=label)
    for left, right, bottom, top in boxes.tolist():
        plan.add_patch(Rectangle((left, bottom), right - left, top - bottom, color="0.75"))
    plan.set(xlim=(-0.15, 0.45), ylim=(-0.4, 0.27), aspect="equal", xlabel="x (m)", ylabel="y (m)")
    turn.axvline(FREE * STEP_S, color="0.5", ls=":")
    turn.set(xlabel="time (s)", ylabel="heading (degrees)")
    turn.legend(frameon=False)
    figure.savefig(Path(__file__).parents[1] / "docs" / "pinned.png", dpi=110)
    print(
        f"wheels turn at {0.9 * 4:g} and {0.6 * 4:g} rad/s; {math.degrees(poses[-1, 2]):.2f} degrees in 3-D at the end"
    )


if __name__ == "__main__":
    main()
