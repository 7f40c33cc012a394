#!/usr/bin/env python3
"""How fast the window answers as somebody sees it who knows nothing of the program.

usage: xvfb-run -a -s "-screen 0 1280x800x24" tests/response/outside.py PROGRAM [SCENE] [TAPS] [WIDTHxHEIGHT]

A key goes down (XTest), and a row of pixels through the middle of the window is read from the X server over and over
until it has changed. The picture rests before each tap, so nothing but the key changes it. Says the times from the key
to the changed pixels, how long one look at them takes, which is how exact that is, and what the program itself says
of the same keys (`--replay`, whose file only ends it). Needs libX11, libXtst, xdotool and openbox, which gives the
window the keys. Ends with 1 if the median from outside is above 50 ms.
"""
import ctypes
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time

MOST_MS = 50.0
# In turn: the view comes and goes.
KEYS = ["w", "s"]


class Image(ctypes.Structure):
    """The beginning of Xlib's XImage."""

    _fields_ = [(name, ctypes.c_int) for name in ("width", "height", "xoffset", "format")] + [
        ("data", ctypes.c_void_p)
    ] + [(name, ctypes.c_int) for name in ("byte_order", "unit", "bit_order", "pad", "depth", "bytes_per_line")]


class Server:
    """An X server, as far as we need one."""

    def __init__(self):
        self.x, self.test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self.x.XOpenDisplay.restype = ctypes.c_void_p
        self.x.XGetImage.restype = ctypes.POINTER(Image)
        self.x.XStringToKeysym.restype = ctypes.c_ulong
        self.display = ctypes.c_void_p(self.x.XOpenDisplay(None))
        if not self.display:
            sys.exit("no X server: see the usage in this file")

    def key(self, name, down):
        symbol = ctypes.c_ulong(self.x.XStringToKeysym(name.encode()))
        code = self.x.XKeysymToKeycode(self.display, symbol)
        self.test.XTestFakeKeyEvent(self.display, code, int(down), ctypes.c_ulong(0))
        self.x.XFlush(self.display)

    def row(self, window, width, y):
        """The pixels of row `y` of a window."""
        image = self.x.XGetImage(
            self.display, ctypes.c_ulong(window), 0, y, width, 1, ctypes.c_ulong(0xFFFFFFFF), 2
        )
        pixels = ctypes.string_at(image.contents.data, image.contents.bytes_per_line)
        self.x.XFree(ctypes.c_void_p(image.contents.data))
        self.x.XFree(image)
        return pixels


def said(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def until(what, found, seconds=60.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = found()
        if value:
            return value
        time.sleep(0.02)
    sys.exit(f"waited {seconds:.0f} s in vain for {what}")


def median(values):
    return sorted(values)[len(values) // 2]


def measure(server, process, taps, width, height):
    """Times from key to pixels and of single looks, ms."""
    window = int(until("a window", lambda: said("xdotool", "search", "--pid", str(process.pid))).split()[-1])
    title = lambda: said("xdotool", "getwindowname", str(window))
    rests = lambda: title().endswith("- done")
    until("the first picture", rests)
    said("xdotool", "windowfocus", "--sync", str(window))
    # What the program tells of itself lies at the top and at the bottom.
    row = lambda: server.row(window, width, height // 2)
    answers, looks = [], []
    for i in range(taps):
        until("the picture to rest", rests)
        time.sleep(0.3)
        key, before = KEYS[i % len(KEYS)], row()
        began = time.perf_counter()
        server.key(key, True)
        while True:
            look = time.perf_counter()
            changed = row() != before
            now = time.perf_counter()
            looks.append(1e3 * (now - look))
            if changed:
                answers.append(1e3 * (now - began))
                break
            if now - began > 5.0:
                sys.exit(f"nothing has changed 5 s after the key {key}")
        server.key(key, False)
        time.sleep(0.1)
    return answers, looks


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else sys.exit(__doc__)
    scene = sys.argv[2] if len(sys.argv) > 2 else "cornell"
    taps = int(sys.argv[3]) if len(sys.argv) > 3 else 40
    width, height = (int(side) for side in (sys.argv[4] if len(sys.argv) > 4 else "960x540").split("x"))
    server = Server()
    manager = None
    if shutil.which("openbox"):
        manager = subprocess.Popen(["openbox"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(1.0)
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as script:
        # Long enough for all taps: it is ended by a key.
        script.write("100000 quit\n")
        script.flush()
        command = [program, scene, "--resolution", f"{width}x{height}", "--spp", "4", "--replay", script.name]
        environment = {**os.environ, "WAYLAND_DISPLAY": ""}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)
        try:
            answers, looks = measure(server, process, taps, width, height)
            said("xdotool", "key", "ctrl+q")
            own = json.loads(process.communicate(timeout=20)[0].splitlines()[-1])
        finally:
            process.kill()
            if manager:
                manager.kill()
    print(f"{scene}, {width}x{height}, {len(answers)} keys")
    print(f"outside: median {median(answers):.1f} ms, least {min(answers):.1f}, most {max(answers):.1f}")
    print(f"one look at the pixels: median {median(looks):.2f} ms")
    print(f"the program's own: median {own['median_ms']:.1f} ms of {own['events']} events")
    sys.exit(median(answers) > MOST_MS)


if __name__ == "__main__":
    main()
