"""A study of one's own: at how little light do champions still reach both goals?"""

from dataclasses import dataclass, field

import pandas as pd
from matplotlib.figure import Figure

import epuckhebb


@dataclass(kw_only=True)
class Dimming(epuckhebb.Study):
    """Success of champions, without plasticity and with the paper's rule, from bright light to the dark."""

    champions: list[str] = field(default_factory=lambda: ["reference_1", "reference_2", "reference_3"])
    lights: list[float] = field(default_factory=lambda: [1.0, 0.3, 0.1, 0.03])
    repeats: int = 3
    duration_s: float = 200.0

    def plan(self):
        """A job for each champion: what it depends on, and nothing else."""
        shared = {"lights": self.lights, "repeats": self.repeats, "duration_s": self.duration_s}
        return [{"genome": champion, **shared} for champion in self.champions]

    @classmethod
    def do(cls, job):
        """The lifetimes of a champion at every light."""
        rows = []
        for light in job["lights"]:
            settings = {"scenario": "highlight", "scenario.light": light, "repeats": job["repeats"]}
            settings |= {"lifetime.duration_s": job["duration_s"], "lifetime.record_every": 0, "threads": 1}
            rows.append(epuckhebb.evaluate(job["genome"], progress=False, **settings).metrics)
        return {"metrics": pd.concat(rows)}

    def tables(self, runs):
        """Success over all champions and sides, for each controller and light."""
        metrics = pd.concat([run.table("metrics.csv") for run in runs])
        shares = metrics.groupby(["controller", "light"], as_index=False).success.agg(["mean", "size"])
        return {"success": shares.rename(columns={"mean": "success", "size": "lifetimes"})}

    def figures(self, run):
        """Success against light, of the table in the folder of the study."""
        figure = Figure(figsize=(5, 3.5), layout="constrained")
        axes = figure.subplots()
        for controller, own in run.table("success.csv").groupby("controller"):
            axes.plot(own.light, own.success, marker="o", label=controller)
        axes.set(xscale="log", xlabel="light (1: bright)", ylabel="success", ylim=(-0.05, 1.05))
        axes.legend(frameon=False)
        figure.set_label("Share of the lifetimes that end at the goal, by light")
        return {"success": figure}
