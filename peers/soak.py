#!/usr/bin/env python3
"""A soak of `servotwin watch`: live streams at 100 Hz with everything going wrong around the diagnosis.

    cargo build --release --features full && python3 peers/soak.py --seconds 600

Two watches run side by side, one on UDP and one on MQTT, through mosquitto_sub and a pipe (where mosquitto is
installed; peers/setup.sh installs it).
The log has a fault every 30 s, from an onset on. Meanwhile

- the disk is full: events go to /dev/full, and no file may be larger than 64 KiB,
- the sender of the UDP stream is silent for 4 s now and then, and a stranger sends to the same port,
- the broker is killed twice and started again after 4 s.

Every fault must be reported within LATENCY_S of wall time after its first row was sent, every silence within its time,
and the watches must say at the end what was lost. Exit code 0 if all of that holds. Only the Python library is needed.
"""

import argparse
import csv
import json
import os
import pathlib
import resource
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
RATE_HZ = 100
BLOCK_S = 30.0
ONSET_S, FAULT_S = 12.0, 10.0
QUIET_S, SILENCE_S = 24.0, 4.0
LATENCY_S = 3.0
NO_DATA_S = 2.0
HEARTBEAT_S = 5.0
# A broker that is away is noticed at once where it was killed; a client tries again after a while.
RECONNECT_S = 12.0
FAULTY = {"detected", "isolated", "unknown"}
FAULTS = [
    "actuator_1.servo_valve.bias_positive",
    "actuator_2.sensor_pressure_a.bias_positive",
    "actuator_1.sensor_pressure_a.bias_positive",
    "actuator_2.servo_valve.bias_negative",
]
COMMAND = "noise:rms=3deg,bandwidth=0.8Hz,seed=5"


def run(arguments):
    done = subprocess.run(arguments, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))}\n{done.stderr}")


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Log:
    """Rows at 100 Hz: healthy, but for a fault in each block."""

    def __init__(self, binary, folder, seconds):
        def simulate(name, more):
            path = folder / name
            run([binary, "simulate", "--command", COMMAND, "--load", "70%", "--noise", "7", "-q"]
                + ["--rate", f"{RATE_HZ}Hz", "--duration", f"{seconds + 1}s", "--out", path] + more)
            with open(path) as file:
                rows = list(csv.reader(file))
            return rows[0], [",".join(row) for row in rows[1:]]

        self.header, healthy = simulate("healthy.csv", [])
        used = FAULTS[: max(1, min(len(FAULTS), int(seconds // BLOCK_S)))]
        faulty = [simulate(f"fault_{k}.csv", ["--fault", f"{fault}=1"])[1] for k, fault in enumerate(used)]
        self.rows, self.onsets = list(healthy), []
        block = 0
        while (block + 1) * BLOCK_S <= seconds + 1e-9:
            onset_s = block * BLOCK_S + ONSET_S
            first, last = round(onset_s * RATE_HZ), round((onset_s + FAULT_S) * RATE_HZ)
            self.rows[first:last] = faulty[block % len(used)][first:last]
            self.onsets.append((onset_s, used[block % len(used)]))
            block += 1


class Watch(threading.Thread):
    """A watch, and every line that it wrote with the wall time at which it came."""

    def __init__(self, name, binary, source, folder, files, stdin=None):
        super().__init__(daemon=True)
        self.name, self.lines = name, []
        self.checkpoint = folder / f"{name}.json"
        arguments = [binary, "watch", source, "--map", files["map"], "--study", files["study"]]
        arguments += ["--model", files["model"], "--json", "--no-data-after", f"{NO_DATA_S}s"]
        arguments += ["--heartbeat", f"{HEARTBEAT_S}s"]
        arguments += ["--events", "/dev/full", "--checkpoint", self.checkpoint]
        self.stderr = open(folder / f"{name}.stderr", "w+")
        # Python would give the signal of a file that grows too large back to its child.
        self.process = subprocess.Popen(
            arguments, stdin=stdin, stdout=subprocess.PIPE, stderr=self.stderr, text=True,
            preexec_fn=limit_files, restore_signals=False)

    def run(self):
        for line in self.process.stdout:
            self.lines.append((time.monotonic(), json.loads(line)))

    def end(self):
        self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = None
        self.join(timeout=10)
        return code

    def events(self, kind):
        return [(at, line) for at, line in self.lines if line.get("event") == kind]

    def changes(self):
        return [(at, line) for at, line in self.lines if "place" in line]


def limit_files():
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, 1 << 16))


class Broker:
    """mosquitto on a port of its own."""

    def __init__(self, folder):
        self.port = free_port(socket.SOCK_STREAM)
        self.settings = folder / "mosquitto.conf"
        self.settings.write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\n")
        self.program = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin")
        self.process = None
        self.publisher = None

    def start(self):
        quiet = subprocess.DEVNULL
        self.process = subprocess.Popen([self.program, "-c", self.settings], stdout=quiet, stderr=quiet)
        for _ in range(200):
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1).close()
                return
            except OSError:
                time.sleep(0.05)
        sys.exit("mosquitto does not start")

    def kill(self):
        self.process.kill()
        self.process.wait()

    def subscribe(self):
        """The client whose lines a watch reads."""
        arguments = ["mosquitto_sub", "-p", str(self.port), "-t", "soak/rig", "-R", "-F", "%p"]
        return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)

    def publish(self, payload):
        """Sends a message of quality 0, or none while the broker is away."""
        try:
            if self.publisher is None:
                self.publisher = socket.create_connection(("127.0.0.1", self.port), timeout=0.2)
                self.publisher.sendall(b"\x10\x10\x00\x04MQTT\x04\x02\x00\x00\x00\x04soak")
                self.publisher.recv(4)
            topic = b"soak/rig"
            body = struct.pack(">H", len(topic)) + topic + payload
            self.publisher.sendall(b"\x30" + length_of(body) + body)
        except OSError:
            self.publisher = None


def length_of(body):
    left, out = len(body), b""
    while True:
        out += bytes([left % 128 | (128 if left >= 128 else 0)])
        left //= 128
        if not left:
            return out


class Feed:
    """Sends the log in real time and does what is to be done meanwhile."""

    def __init__(self, log, seconds, udp_port, broker):
        self.log, self.seconds, self.broker = log, seconds, broker
        self.to = ("127.0.0.1", udp_port)
        self.own, self.stranger = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
        blocks = len(log.onsets)
        self.silences = [b * BLOCK_S + QUIET_S for b in range(blocks) if b % 4 == 0]
        kills = sorted({max(0, round(blocks * part) - 1) for part in (0.4, 0.8)})
        if blocks == 1:
            kills = [0]
        self.kills = [b * BLOCK_S + QUIET_S for b in kills] if broker else []
        if broker and len(self.kills) == 1:
            # Twice even in a short soak.
            self.kills.append(self.kills[0] - BLOCK_S + SILENCE_S + 2.0)
            self.kills = [at for at in self.kills if at > 3.0] or self.kills[:1]
        self.sent = 0
        self.begin = None

    def is_silent(self, time_s):
        return any(at <= time_s < at + SILENCE_S for at in self.silences)

    def run(self):
        self.begin = time.monotonic()
        due = sorted([(at, "kill") for at in self.kills] + [(at + SILENCE_S, "start") for at in self.kills])
        for k in range(round(self.seconds * RATE_HZ)):
            time_s = k / RATE_HZ
            delay = self.begin + time_s - time.monotonic()
            if delay > 0:
                time.sleep(delay)
            while due and due[0][0] <= time_s:
                _, action = due.pop(0)
                threading.Thread(target=getattr(self.broker, action)).start()
            datagram = (",".join(self.log.header) + "\n" + self.log.rows[k] + "\n").encode()
            if not self.is_silent(time_s):
                self.own.sendto(datagram, self.to)
                self.sent += 1
                if k % 50 == 7 and k > 100:
                    self.stranger.sendto(datagram, self.to)
            if self.broker:
                self.broker.publish(datagram)

    def wall(self, time_s):
        return self.begin + time_s


def check_faults(watch, feed, failures):
    latencies = []
    for onset_s, fault in feed.log.onsets:
        found = [at - feed.wall(onset_s) for at, line in watch.changes()
                 if line["state"] in FAULTY and onset_s - 0.02 <= line["time_s"] <= onset_s + FAULT_S]
        if not found or min(found) > LATENCY_S:
            when = f"after {min(found):.2f} s" if found else "not reported"
            failures.append(f"{watch.name}: {fault} at {onset_s:.0f} s: {when}")
        latencies += [min(found)] if found else []
    return latencies


def check_silences(watch, feed, begins, back_s, failures):
    for begin_s in begins:
        wall = feed.wall(begin_s)
        said = [at - wall for at, line in watch.events("no_data") if 0 <= at - wall <= NO_DATA_S + 3.0]
        again = [at - wall for at, line in watch.events("data_again") if SILENCE_S <= at - wall <= back_s]
        if not said:
            failures.append(f"{watch.name}: silent at {begin_s:.0f} s, and no 'no data' within {NO_DATA_S + 3.0} s")
        if not again:
            failures.append(f"{watch.name}: silent at {begin_s:.0f} s, and no 'data again' within {back_s} s")


def check_end(watch, code, failures):
    def expect(holds, what):
        if not holds:
            failures.append(f"{watch.name}: {what}")

    expect(code == 1, f"exit code {code}, and 1 is that of a watch with files that are lost")
    summary = watch.lines[-1][1] if watch.lines and "document" in watch.lines[-1][1] else {}
    failed = summary.get("failed", {})
    expect("/dev/full" in failed, "the full disk of --events is not reported")
    expect("overflow" not in [one["kind"] for one in summary.get("met", [])], "datagrams were lost on the way to the diagnosis")
    beats = [at for at, _ in watch.events("heartbeat")]
    gaps = [b - a for a, b in zip(beats, beats[1:])]
    expect(beats and max(gaps, default=0) < HEARTBEAT_S + 2, f"heartbeats stop: {max(gaps, default=0):.1f} s")
    return summary


def soak(options, folder):
    binary = pathlib.Path(options.binary).resolve()
    study, map_file = HERE / "soak.toml", folder / "map.toml"
    run([binary, "study", study, "--suite", "flights", "--out", folder / "out", "-q"])
    log = Log(binary, folder, options.seconds)
    run([binary, "watch", folder / "healthy.csv", "--make-map", map_file, "-q"])
    files = {"map": map_file, "study": study, "model": folder / "out" / "diagnoser-realistic.json"}
    port = free_port(socket.SOCK_DGRAM)
    broker = Broker(folder)
    if broker.program is None:
        print("mosquitto is not installed: only UDP")
        broker = None
    else:
        broker.start()
    feed = Feed(log, options.seconds, port, broker)
    watches = [Watch("udp", binary, f"udp://127.0.0.1:{port}", folder, files)]
    if broker:
        client = broker.subscribe()
        watches.append(Watch("mqtt", binary, "-", folder, files, client.stdout))
    for watch in watches:
        watch.start()
    time.sleep(3)
    feed.run()
    time.sleep(0.5)
    codes = [watch.end() for watch in watches]
    if broker:
        client.kill()
        broker.kill()
    failures = []
    for watch, code in zip(watches, codes):
        is_udp = watch.name == "udp"
        latencies = check_faults(watch, feed, failures)
        begins, back_s = (feed.silences, SILENCE_S + 2) if is_udp else (feed.kills, RECONNECT_S)
        check_silences(watch, feed, begins, back_s, failures)
        summary = check_end(watch, code, failures)
        if is_udp:
            foreign = sum(one["count"] for one in summary.get("met", []) if one["kind"] == "foreign_sender")
            frames = summary.get("frames", 0)
            if frames != feed.sent + foreign or foreign == 0:
                failures.append(f"udp: {frames} datagrams counted, {feed.sent} sent, {foreign} of a stranger")
        worst = f"{max(latencies):.2f} s" if latencies else "none"
        print(f"{watch.name}: {len(latencies)} of {len(log.onsets)} faults, slowest {worst}; {len(begins)} silences; "
              f"{summary.get('frames')} frames, {summary.get('judged')} judged; "
              f"lost {summary.get('unsent')}; failed {list(summary.get('failed', {}))}")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="how long the streams are [600]")
    parser.add_argument("--binary", default=HERE.parent / "target/release/servotwin")
    parser.add_argument("--keep", help="a folder that stays, with everything that was written")
    options = parser.parse_args()
    if options.seconds < BLOCK_S:
        sys.exit(f"--seconds: at least {BLOCK_S:.0f}, the time of one fault")
    with tempfile.TemporaryDirectory(prefix="servotwin-soak-") as temporary:
        folder = pathlib.Path(options.keep or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        failures = soak(options, folder)
    for failure in failures:
        print(f"FAILED {failure}")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
