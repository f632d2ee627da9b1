"""The machine of a measurement, and what its processes and sockets used, as text and numbers. Standard library only."""
import datetime
import os
import pathlib
import re
import subprocess


def cpu_ns_by_thread(pid):
    """CPU of each thread in ns, from schedstat: finer than the 10 ms of /proc/PID/stat. Empty when the process has ended."""
    used = {}
    for task in pathlib.Path(f"/proc/{pid}/task").glob("*"):
        try:
            used[task.name, (task / "comm").read_text().strip()] = int((task / "schedstat").read_text().split()[0])
        except (FileNotFoundError, ProcessLookupError):
            continue  # a thread that has just ended
    return used


def cpu_s(*pids):
    return sum(sum(cpu_ns_by_thread(pid).values()) for pid in pids) / 1e9


def resident_mb(*pids):
    """Now, not at the peak."""
    total = 0
    for pid in pids:
        found = re.search(r"^VmRSS:\s+(\d+) kB", pathlib.Path(f"/proc/{pid}/status").read_text(), re.M)
        total += int(found[1]) if found else 0
    return total / 1024


def socket_bytes(port):
    """(received, sent) by the connections that this TCP port of the machine has now: payload, without headers."""
    said = subprocess.run(["ss", "-tinH", f"sport = :{port}"], capture_output=True, text=True, check=True).stdout
    count = lambda name: sum(map(int, re.findall(rf"\b{name}:(\d+)", said)))  # noqa: E731
    return count("bytes_received"), count("bytes_sent")


def description():
    """One sentence, dated: processor, memory, kernel, and how busy the machine was."""
    info = pathlib.Path("/proc/cpuinfo").read_text()
    name = re.search(r"^model name\s*:\s*(.+)$", info, re.M)
    memory_kb = int(re.search(r"^MemTotal:\s+(\d+)", pathlib.Path("/proc/meminfo").read_text(), re.M)[1])
    debian = pathlib.Path("/etc/debian_version")
    system = f"Debian {debian.read_text().strip()}" if debian.exists() else "not Debian"
    return (f"{datetime.datetime.now(datetime.timezone.utc):%Y-%m-%d %H:%M} UTC, {os.cpu_count()} cores"
            f" ({name[1].strip() if name else os.uname().machine}), {memory_kb / 1048576:.0f} GiB, {system}, Linux"
            f" {os.uname().release}, load before the first round {os.getloadavg()[0]:.1f}")
