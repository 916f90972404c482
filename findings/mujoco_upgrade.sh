# MuJoCo: `pip install --upgrade` from 3.17 to 4.0.0 ends well and leaves no library: mujoco-core is installed before the old files are removed.
set -- mujoco==3.17.0
. "$(dirname "$0")/run.sh" <<'PYTHON'
import subprocess, sys
def call(*words):
    ended = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    return ended.returncode, (ended.stdout + ended.stderr).strip().splitlines()[-1:]
print("3.17.0:", call("-c", "import mujoco; print(mujoco.__version__)"))
print("upgrade:", upgraded := call("-m", "pip", "install", "--quiet", "--disable-pip-version-check", "mujoco==4.0.0"))
print("pip check:", checked := call("-m", "pip", "check"))
print("4.0.0:", imported := call("-c", "import mujoco; print(mujoco.__version__)"))
call("-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps", "mujoco-core==4.0.0")
print("after --force-reinstall of mujoco-core:", again := call("-c", "import mujoco; print(mujoco.__version__)"))
assert (upgraded[0], checked[0], imported[0], again[0]) == (0, 0, 1, 0)
PYTHON
