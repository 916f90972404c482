"""Draws docs/pinned.png: a robot that pushes obliquely against a wall, in the plane and in three dimensions."""

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from epuckhebb.analysis.charts import INK, KIND
from epuckhebb.analysis.figures import draw_maze
from epuckhebb.analysis.image import house_style, image, small
from epuckhebb.gym import TMaze
from epuckhebb.tmaze.robot import EPUCK, STEP_S

FREE, STEPS = 250, 900  # steps of driving ahead, and in all
NAMES = {"pymunk": ("physics=pymunk, in the plane", KIND["post_hoc"]), "ode": ("physics=ode, in 3-D", INK)}
EVERY = ["lifetime.noise=0", "lifetime.gain_rad_s=4", "lifetime.duration_s=60"]


def driven(physics, left, right):
    """(STEPS, 3) x, y [m], heading [rad] of a robot that drives ahead to the far wall, then with these outputs."""
    env = TMaze("base", overrides=[f"physics={physics}", *EVERY])
    env.reset(seed=0, options={"side": "left", "key": 1})
    poses = []
    for step in range(STEPS):
        env.step(np.array([1.0, 1.0] if step < FREE else [left, right]))
        poses.append(env.session.pose)
    return np.array(poses), env.world


@house_style()
def main():
    figure = Figure(figsize=(8, 3.6))
    plan, turn = figure.subplots(1, 2)
    for physics, (label, colour) in NAMES.items():
        poses, world = driven(physics, 0.9, 0.6)
        plan.plot(*poses[:, :2].T, color=colour, label=label)
        plan.add_patch(Circle(poses[-1, :2], EPUCK.radius_m, fill=False, color=colour, linewidth=1.5, zorder=3))
        time = np.arange(1, STEPS + 1) * STEP_S
        turn.plot(time, np.degrees(poses[:, 2]), color=colour, label=label)
    draw_maze(plan, world)
    plan.set(xlim=(-0.15, 0.45))
    turn.axvline(FREE * STEP_S, color=INK, linestyle=":")
    turn.set(xlabel="time (s)", ylabel="heading (degrees)")
    turn.legend()
    (Path(__file__).parents[1] / "docs" / "pinned.png").write_bytes(small(image(figure)))
    print(
        f"wheels turn at {0.9 * 4:g} and {0.6 * 4:g} rad/s; {math.degrees(poses[-1, 2]):.2f} degrees in 3-D at the end"
    )


if __name__ == "__main__":
    main()
