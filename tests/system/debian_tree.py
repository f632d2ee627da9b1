"""A minimal Debian 12 in a folder, in which a package is installed, and which can be booted with systemd as its process 1
in namespaces of its own. Needs root and debootstrap. Standard library only."""
import os
import pathlib
import shutil
import signal
import subprocess
import time

# The tree's own /proc, /dev, /run and the hierarchy of cgroups that systemd names its services in; then systemd.
BOOT = r"""
set -e
mount --make-rprivate /
mount --bind "$TREE" "$TREE"
mount -t proc proc "$TREE/proc"
mount -t sysfs -o ro sysfs "$TREE/sys" || true
if [ -f /sys/fs/cgroup/cgroup.controllers ]; then
  mount -t cgroup2 cgroup2 "$TREE/sys/fs/cgroup"
else
  mount -t tmpfs tmpfs "$TREE/sys/fs/cgroup"
  mkdir -p "$TREE/sys/fs/cgroup/systemd"
  mount -t cgroup -o none,name=systemd cgroup "$TREE/sys/fs/cgroup/systemd"
fi
mount -t tmpfs tmpfs "$TREE/run"
mount -t tmpfs tmpfs "$TREE/tmp"
mount -t tmpfs tmpfs "$TREE/dev"
for device in null zero full random urandom tty; do
  touch "$TREE/dev/$device"
  mount --bind "/dev/$device" "$TREE/dev/$device"
done
mkdir -p "$TREE/dev/shm" "$TREE/dev/pts"
mount -t devpts -o newinstance,ptmxmode=0666 devpts "$TREE/dev/pts"
ln -s pts/ptmx "$TREE/dev/ptmx"
touch "$TREE/dev/console"
mount --bind "$CONSOLE" "$TREE/dev/console"
# Not chroot alone: who is in one may make no namespace of users, as the service's unit wants.
cd "$TREE"
mkdir -p .machine
pivot_root . .machine
exec env -i container=lxc PATH=/usr/sbin:/usr/bin:/sbin:/bin sh -c \
  'cd / && umount -l /.machine && exec /lib/systemd/systemd --system'
"""
ENVIRONMENT = {"HOME": "/root", "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C.UTF-8",
               "DEBIAN_FRONTEND": "noninteractive"}


class DebianTree:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.tree = self.folder / "tree"
        self.container = self.init = None

    def make(self, tries=3):
        """From the archive that this machine's apt uses; again when a download breaks off. Raises CalledProcessError."""
        for left in reversed(range(tries)):
            try:
                self._make()
                subprocess.run(["chroot", str(self.tree), "apt-get", "update", "-qq"], check=True, capture_output=True,
                               text=True, timeout=300, env=ENVIRONMENT)
                return
            except subprocess.CalledProcessError:
                shutil.rmtree(self.tree, ignore_errors=True)
                if left == 0:
                    raise

    def _make(self):
        asked = subprocess.run(["apt-get", "indextargets", "--format", "$(REPO_URI) $(CODENAME)", "Created-By: Packages"],
                               capture_output=True, text=True, check=True).stdout
        mirror = next(line.split()[0] for line in asked.splitlines() if line.split()[1] == "bookworm")
        subprocess.run(["debootstrap", "--variant=minbase", "bookworm", str(self.tree), mirror], check=True,
                       capture_output=True, text=True)
        apt = self.tree / "etc" / "apt"
        (apt / "sources.list").unlink(missing_ok=True)
        for name in ("sources.list", "sources.list.d"):
            source = pathlib.Path("/etc/apt") / name
            if source.is_dir():
                shutil.copytree(source, apt / name, dirs_exist_ok=True)
            elif source.exists():
                shutil.copy(source, apt / name)
        dump = subprocess.run(["apt-config", "dump"], capture_output=True, text=True, check=True).stdout
        fetching = [line for line in dump.splitlines() if line.startswith("Acquire::")] + ['Acquire::Retries "5";']
        (apt / "apt.conf.d" / "90machine").write_text("\n".join(fetching) + "\n")
        for name in ("resolv.conf", "hosts"):
            shutil.copy(f"/etc/{name}", self.tree / "etc" / name)
        shutil.copytree("/usr/local/share/ca-certificates", self.tree / "usr/local/share/ca-certificates",
                        dirs_exist_ok=True)

    def run(self, *command, check=True, **more):
        """In the tree as it lies there, nothing booted, with this machine's network and /proc."""
        inside = 'mount -t proc proc "$0/proc" && exec chroot "$0" "$@"'
        return self._run(["unshare", "-m", "bash", "-c", inside, str(self.tree), *command], check, **more)

    def boot(self):
        """systemd as process 1, with a network of its own: the service's ports are free there."""
        (self.folder / "console").touch()
        environment = {**ENVIRONMENT, "TREE": str(self.tree), "CONSOLE": str(self.folder / "console")}
        self.container = subprocess.Popen(["setpriv", "--pdeathsig", "KILL", "unshare", "-mpfiunC", "--kill-child", "bash", "-c",
                                           BOOT], env=environment,
                                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        children = pathlib.Path(f"/proc/{self.container.pid}/task/{self.container.pid}/children")
        self.wait(lambda: children.read_text().split(), "the container")
        self.init = children.read_text().split()[0]
        self.wait(lambda: self.inside("systemctl", "is-system-running", check=False).stdout.strip() in
                  ("running", "degraded"), "systemd")

    def inside(self, *command, check=True, **more):
        """In the booted tree."""
        return self._run(["nsenter", "-t", self.init, "-m", "-p", "-n", "-i", "-u", "-r", "-w", *command], check, **more)

    def in_its_network(self, *command, check=True, **more):
        """A program of this machine that sees the tree's ports."""
        return self._run(["nsenter", "-t", self.init, "-n", *command], check, **more)

    def main_pid(self, service):
        """Of a service, as this machine numbers it; None while it does not run."""
        inner = self.inside("systemctl", "show", "-p", "MainPID", "--value", service).stdout.strip()
        for status in pathlib.Path("/proc").glob("[0-9]*/status"):
            try:
                line = next(line for line in status.read_text().splitlines() if line.startswith("NSpid:"))
                same = os.readlink(status.parent / "ns/pid") == os.readlink(f"/proc/{self.init}/ns/pid")
            except (OSError, StopIteration):
                continue
            if same and inner != "0" and line.split()[-1] == inner:
                return int(status.parent.name)
        return None

    def close(self):
        if self.container and self.container.poll() is None:
            os.kill(int(self.init or self.container.pid), signal.SIGKILL)
            self.container.wait(timeout=60)

    @staticmethod
    def wait(is_there, what, for_s=120):
        deadline = time.monotonic() + for_s
        while not is_there():
            if time.monotonic() > deadline:
                raise TimeoutError(f"{what} did not come within {for_s} s")
            time.sleep(0.1)

    @staticmethod
    def _run(command, check, timeout_s=300, **more):
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, env=ENVIRONMENT,
                              stdin=subprocess.DEVNULL, **more)
        if check and done.returncode != 0:
            raise AssertionError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}")
        return done
