# hydra-optuna-sweeper: range(1,3) has 3 among its values; the range of Hydra's own sweeper ends before it.
set -- hydra-core==1.3.2 hydra-optuna-sweeper==1.3.0 "setuptools<81"
. "$(dirname "$0")/run.sh" <<'PYTHON'
import pathlib, subprocess, sys
pathlib.Path("app.py").write_text(
    "import hydra\n"
    "@hydra.main(version_base='1.3', config_path=None)\n"
    "def main(cfg):\n"
    "    open('/dev/stdout', 'a').write(f'seed {cfg.seed}\\n')\n"
    "    return 0.0\n"
    "main()\n"
)
def seeds(*words):
    call = [sys.executable, "-W", "ignore", "app.py", "-m", "+seed=range(1,3)", *words]
    lines = subprocess.run(call, check=True, capture_output=True, text=True).stdout.splitlines()
    return sorted({int(line.split()[1]) for line in lines if line.startswith("seed ")})
optuna = ["hydra/sweeper=optuna", "hydra.sweeper.n_trials=40", "hydra.sweeper.sampler.seed=1"]
found = {"basic": seeds(), "optuna": seeds(*optuna)}
print("seeds of range(1,3):", found)
assert found == {"basic": [1, 2], "optuna": [1, 2, 3]}
PYTHON
