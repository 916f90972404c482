"""A SLURM cluster of one node on the loopback, for as long as a command runs: `python slurm_cluster.py COMMAND...`.

Everything it writes is in a temporary folder: its keys, sockets, logs and configuration. Must be root, as slurmd must.
"""

import getpass
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CONFIGURATION = """\
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={control}
SlurmdPort={daemon}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=10
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
KillWait=5
SchedulerParameters=sched_interval=5
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def free_port():
    with socket.socket() as chosen:
        chosen.bind(("127.0.0.1", 0))
        return chosen.getsockname()[1]


def configure(folder):
    for name in ("state", "spool"):
        (folder / name).mkdir()
    (folder / "munge.key").write_bytes(os.urandom(128))
    (folder / "munge.key").chmod(0o600)
    version = subprocess.run(["slurmd", "-V"], capture_output=True, text=True, check=True).stdout.split()[1]
    plugin = "cgroup/v1" if int(version.split(".")[0]) < 23 else "disabled"
    (folder / "cgroup.conf").write_text(f"CgroupPlugin={plugin}\n")
    values = {"control": free_port(), "daemon": free_port(), "user": getpass.getuser(), "cores": os.cpu_count()}
    values |= {"host": socket.gethostname().split(".")[0], "memory": 4000, "folder": folder}
    (folder / "slurm.conf").write_text(CONFIGURATION.format(**values))


def daemons(folder):
    munge = {name: f"--{name}={folder}/munge.{name}" for name in ("socket", "log-file", "pid-file", "seed-file")}
    munged = ["munged", "--foreground", "--force", f"--key-file={folder}/munge.key", *munge.values()]
    return [munged, ["slurmctld", "-D", "-i"], ["slurmd", "-D"]]


def wait_until_idle(seconds=20):
    for _ in range(seconds * 2):
        told = subprocess.run(["sinfo", "--noheader", "--format=%t"], capture_output=True, text=True, check=False)
        if told.stdout.strip() == "idle":
            return
        time.sleep(0.5)
    raise TimeoutError(f"the node did not become idle: {told.stdout}{told.stderr}")


def main(command):
    folder = Path(tempfile.mkdtemp(prefix="slurm"))
    folder.chmod(0o755)
    configure(folder)
    os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
    started = []
    try:
        for daemon in daemons(folder):
            with (folder / f"{daemon[0]}.out").open("w") as out:
                started.append(subprocess.Popen(daemon, stdout=out, stderr=out))
            time.sleep(1)
        wait_until_idle()
        return subprocess.run(command, check=False).returncode
    except TimeoutError:
        for log in [*folder.glob("*.log"), *folder.glob("*.out")]:
            print(f"--- {log.name}\n{log.read_text()}", file=sys.stderr)
        raise
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
