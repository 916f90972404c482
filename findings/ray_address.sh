# hydra-ray-launcher gives ray.init an object_store_memory, which a running cluster refuses, unless the key is null.
set -- hydra-core==1.3.2 hydra-ray-launcher==1.2.2 ray==2.60.0 "setuptools<81"
. "$(dirname "$0")/run.sh" <<'PYTHON'
import os, pathlib, subprocess, sys
ray = str(pathlib.Path(sys.executable).with_name("ray"))
os.environ |= {"PATH": f"{pathlib.Path(ray).parent}:{os.environ['PATH']}", "RAY_raylet_start_wait_time_s": "120"}
pathlib.Path("app.py").write_text(
    "import hydra\n"
    "@hydra.main(version_base='1.3', config_path=None)\n"
    "def main(cfg):\n"
    "    print('seed', cfg.seed)\n"
    "main()\n"
)
subprocess.run([ray, "start", "--head", "--num-cpus=1", "--include-dashboard=false", "--disable-usage-stats"], check=True,
               stdout=subprocess.DEVNULL)
def call(*words):
    launch = [sys.executable, "-W", "ignore", "app.py", "-m", "+seed=1", "hydra/launcher=ray", *words]
    ended = subprocess.run(launch, capture_output=True, text=True)
    return ended.returncode, "object_store_memory must not be provided" in ended.stderr
try:
    address = "hydra.launcher.ray.init.address=auto"
    found = {"address=auto": call(address), "and null": call(address, "+hydra.launcher.ray.init.object_store_memory=null")}
finally:
    subprocess.run([ray, "stop", "--force"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
print("exit code, whether the size of the store is refused:", found)
assert found == {"address=auto": (1, True), "and null": (0, False)}
PYTHON
