import ctypes
import json
import mmap
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from ctypes import c_bool, c_char_p, c_double, c_int, c_int64, c_size_t, c_void_p

libc = ctypes.CDLL(None)
libc.mmap.restype = c_void_p
libc.mmap.argtypes = [c_void_p, c_size_t, c_int, c_int, c_int, ctypes.c_long]
libc.mprotect.argtypes = [c_void_p, c_size_t, c_int]
libc.munmap.argtypes = [c_void_p, c_size_t]
libc.dlclose.argtypes = [c_void_p]
libc.setlocale.restype = c_char_p
library = None
instances, states, sizes, saved = {}, {}, {}, {}
room_for_results = "."
out = sys.stdout
quiet = False
messages = threading.local()
# Letters of the module struct.
LETTERS = dict(F64="d", F32="f", I8="b", U8="B", I16="h", U16="H", I32="i", U32="I", I64="q", U64="Q", Size="N", Pointer="P")


def say(*words):
    if not quiet:
        print(*words, file=out, flush=True)


def guarded(content):
    """The address of an array that ends where memory ends: reading or writing beyond it is a crash."""
    page = mmap.PAGESIZE
    length = ((len(content) + page - 1) // page + 2) * page
    flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
    begin = libc.mmap(None, length, mmap.PROT_READ | mmap.PROT_WRITE, flags, -1, 0)
    libc.mprotect(begin + length - page, page, 0)
    ctypes.memset(begin, 0x5A, length - page)
    address = begin + length - page - len(content)
    ctypes.memmove(address, content, len(content))
    if not hasattr(messages, "maps"):
        messages.maps = []
    messages.maps.append((begin, length))
    return address


def release(before):
    """Unmaps the arrays of a call: an FMU must not use them afterwards."""
    while len(messages.maps) > before:
        libc.munmap(*messages.maps.pop())


def lasting(address):
    """An array that is kept."""
    messages.maps.pop()
    return address


def room(size):
    return guarded(b"\x5a" * size)


def string(content):
    return None if content is None else guarded(bytes(content) + b"\0")


def word(address):
    return c_size_t.from_address(address).value


def slot(of, place, size=8):
    if place not in of:
        of[place] = lasting(guarded(bytes(8)) if size == 8 else room(size))
    return of[place]


def bits_of(letter, numbers):
    width = struct.calcsize(letter)
    return b"".join((number & (1 << 8 * width) - 1).to_bytes(width, sys.byteorder) for number in numbers)


def hexes(content):
    return "-" if content is None else bytes(content).hex()


def log(status, category, message):
    messages.said = getattr(messages, "said", "") + f"{status} {hexes(category)} {hexes(message)};"
    say("    log:", status, category, message)


@ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, *[c_size_t] * 4, *[c_double] * 4)
def log_of_fmi2(_, name, status, category, message, *values):
    """On Linux, a function without a list of arguments gets integers and pointers first, then numbers."""
    words, numbers = iter(values[:4]), iter(values[4:])

    def value(found):
        kind = found.group(1)
        if kind == b"%":
            return b"%"
        if kind == b"s":
            return ctypes.string_at(next(words))
        return found.group(0) % (next(numbers) if kind in b"eEfFgG" else next(words))

    if message:
        try:
            message = re.sub(rb"%[-+ #0-9.]*[hlqjzt]*([a-zA-Z%])", value, message)
        except (StopIteration, ValueError, TypeError):
            pass
    log(status, category, message)


@ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
def log_of_fmi3(_, status, category, message):
    log(status, category, message)


class Callbacks(ctypes.Structure):
    _fields_ = [("logger", c_void_p), ("allocate", c_void_p), ("free", c_void_p), ("finished", c_void_p), ("own", c_void_p)]


def address_of(function):
    return ctypes.cast(function, c_void_p).value


callbacks = Callbacks(address_of(log_of_fmi2), address_of(libc.calloc), address_of(libc.free), None, None)


def function(name, result=c_int):
    if not hasattr(library, name):
        sys.exit(f"{name} is not in the library")
    found = library[name]
    found.restype = result
    return found


def record(identity, status, written=()):
    """Keeps the results of a call that matters."""
    kind = next(iter(EVIDENCE)) if isinstance(EVIDENCE, dict) else ""
    proofs = EVIDENCE[kind] if kind in ("Differ", "Same") else []
    if kind == "AnyDiffer" and any(identity in pair for pair in EVIDENCE[kind]):
        proofs = [{"id": identity, "matters": [True, True, False]}]
    for proof in proofs:
        if proof["id"] == identity:
            parts = [f"{status};", "".join(written), getattr(messages, "said", "")]
            text = "".join(part for part, matters in zip(parts, proof["matters"]) if matters)
            with open(f"{room_for_results}/r{identity}", "w") as file:
                file.write(text)


def make(identity, place, how):
    fmi3 = hasattr(library, "fmi3GetVersion")

    def encode(text):
        return c_void_p(string(None if text is None else text.encode()))

    location = f"{FOLDER}/resources/" if fmi3 else f"file://{FOLDER}/resources"
    name, token, resources = encode(how["name"]), encode(how["token"]), encode(location if how["resources"] else None)
    flags = [c_bool(False), c_bool(how["logging"])]
    if not fmi3:
        call = function("fmi2Instantiate", c_void_p)
        made = call(name, c_int(how["co_simulation"]), token, resources, ctypes.byref(callbacks), 0, int(how["logging"]))
    elif not how["co_simulation"]:
        made = function("fmi3InstantiateModelExchange", c_void_p)(name, token, resources, *flags, None, log_of_fmi3)
    else:
        flags += [c_bool(how["event_mode"]), c_bool(how["early_return"])]
        call = function("fmi3InstantiateCoSimulation", c_void_p)
        made = call(name, token, resources, *flags, None, c_size_t(0), None, log_of_fmi3, None)
    release(0)
    instances[place] = made
    say(f"instance {place}:", "made" if made else "NULL")
    record(identity, int(bool(made)))


def argument(name, arg, written, damage):
    """The value that is passed; what is written to it is shown by a function in `written`."""
    if not isinstance(arg, dict):
        return c_void_p(None) if arg == "Null" else c_void_p(room(64) + 1)
    kind, value = next(iter(arg.items()))

    def given(content):
        address = guarded(content)
        damage.append((address, content))
        return c_void_p(address)

    def numbers(address, letter, count):
        width = struct.calcsize(letter)
        content = ctypes.string_at(address, width * count)
        if letter == "P":
            pointers = struct.unpack(f"{count}P", content)
            return "".join(f"{hexes(ctypes.string_at(at) if at and at != 0x5A5A5A5A5A5A5A5A else None)}," for at in pointers) + ";"
        values = [int.from_bytes(content[at * width : (at + 1) * width], sys.byteorder) for at in range(count)]
        return "".join(f"{value:x}," for value in values) + ";"

    if kind == "Real":
        return c_double(struct.unpack("d", struct.pack("Q", value))[0])
    if kind == "Whole":
        return c_int64(value)
    if kind == "In":
        return given(bits_of(LETTERS[value[0]], value[1]))
    if kind == "Texts":
        return given(struct.pack(f"{len(value)}P", *[string(text) or 0 for text in value]))
    if kind == "Blobs":
        return given(struct.pack(f"{len(value)}P", *[guarded(bytes(blob)) for blob in value]))
    if kind == "Out":
        letter, count = LETTERS[value[0]], value[1]
        address = room(struct.calcsize(letter) * count)
        if name != "fmi3GetBinary":
            written.append(lambda: numbers(address, letter, count))
        damage.append((address, None))
        return c_void_p(address)
    if kind == "State":
        return c_void_p(word(slot(states, value)))
    if kind == "StateOut":
        written.append(lambda: f"{int(word(states[value]) != 0)},;")
        return c_void_p(slot(states, value))
    if kind == "Saved":
        return given(ctypes.string_at(slot(saved, value, 1 << 24), word(slot(sizes, value))))
    if kind == "SavedSize":
        return c_size_t(word(slot(sizes, value)))
    if kind == "SizeOut":
        written.append(lambda: f"{word(sizes[value]):x},;")
        return c_void_p(slot(sizes, value))
    size = word(slot(sizes, value))
    address = room(size)

    def keep():
        ctypes.memmove(slot(saved, value, 1 << 24), address, size)
        return numbers(address, "B", size)

    written.append(keep)
    return c_void_p(address)


def check(address, content):
    """Whether bytes before an array, or of one that is for reading, have changed."""
    begin = address - address % mmap.PAGESIZE - mmap.PAGESIZE
    before = ctypes.string_at(begin, address - begin)
    changed = content is not None and ctypes.string_at(address, len(content)) != content
    if changed or before != b"\x5a" * len(before):
        say("    an array was damaged")
        with open(f"{room_for_results}/damage", "w"):
            pass


def call(identity, of, name, args):
    written, damage = [], []
    messages.said = ""
    values = [argument(name, arg, written, damage) for arg in args]
    instance = None if of is None else instances.get(of)
    if of is not None and not instance:
        return
    status = function(name)(c_void_p(instance), *values)
    results = [show() for show in written]
    say(f"{name}: {status}", *results)
    record(identity, status, results)
    if EVIDENCE == "Damage":
        for address, content in damage:
            check(address, content)
    if hasattr(messages, "maps"):
        release(0)


def measure(identity):
    with open("/proc/self/statm") as file:
        resident = int(file.read().split()[1]) * mmap.PAGESIZE
    memory = resident
    if hasattr(libc, "mallinfo2"):

        class Info(ctypes.Structure):
            _fields_ = [(f"n{place}", c_size_t) for place in range(10)]

        libc.mallinfo2.restype = Info
        info = libc.mallinfo2()
        memory = info.n7 + info.n4
    threads, files = len(os.listdir("/proc/self/task")), len(os.listdir("/proc/self/fd"))
    handlers = [signal.getsignal(one) for one in (signal.SIGSEGV, signal.SIGFPE, signal.SIGABRT)]
    # Rounding toward zero, flushing and traps show in sums and quotients of small numbers.
    tiny = ctypes.c_double(5e-324).value
    settings = f"{os.getcwd()} {libc.setlocale(6, None)} {handlers} {tiny * 1.0 == 0.0} {0.1 + 0.2}"
    say("memory:", memory, "threads:", threads, "files:", files)
    with open(f"{room_for_results}/r{identity}", "w") as file:
        json.dump({"Memory": memory, "Threads": threads, "Files": files, "Settings": settings}, file)


def play(steps):
    global quiet
    for numbered in steps:
        identity, step = numbered["id"], numbered["step"]
        kind, value = next(iter(step.items())) if isinstance(step, dict) else (step, None)
        if kind == "Make":
            make(identity, *value)
        elif kind == "Free":
            name = "fmi3FreeInstance" if hasattr(library, "fmi3FreeInstance") else "fmi2FreeInstance"
            function(name, None)(c_void_p(instances.pop(value, None)))
        elif kind == "Call":
            call(identity, value["of"], value["function"], value["args"])
        elif kind == "Version":
            version = function(value, c_char_p)()
            say(f"{value}: {version}")
            with open(f"{room_for_results}/r{identity}", "w") as file:
                file.write(f"{hexes(version)},;")
        elif kind == "Repeat":
            quiet = True
            for _ in range(value[0]):
                play(value[1])
            quiet = False
        elif kind == "Parallel":
            threads = [threading.Thread(target=play, args=(steps,)) for steps in value]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        elif kind == "Measure":
            measure(identity)
        elif kind == "Unload":
            libc.dlclose(library._handle)
            load()
        elif kind == "Quit":
            out.flush()
            libc.exit(0)


def load():
    global library
    library = ctypes.CDLL(f"{FOLDER}/{LIBRARY}", mode=os.RTLD_NOW if EVIDENCE == "End" else os.RTLD_LAZY)


def phase(number):
    """A part of the calls in this process. Its output is kept apart from that of the library."""
    global out
    out = os.fdopen(os.dup(1), "w")
    printed = os.open(f"{room_for_results}/printed", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(printed, 1)
    load()
    for name in os.listdir(room_for_results):
        if name.startswith("bytes"):
            with open(f"{room_for_results}/{name}", "rb") as file:
                content = file.read()
            ctypes.memmove(slot(saved, int(name[5:]), 1 << 24), content, len(content))
            c_size_t.from_address(slot(sizes, int(name[5:]))).value = len(content)
    play(PHASES[number])
    for place, address in saved.items():
        with open(f"{room_for_results}/bytes{place}", "wb") as file:
            file.write(ctypes.string_at(address, word(slot(sizes, place))))
    out.flush()
    libc.fflush(None)
    os._exit(0)


def descendants():
    """Processes that this one has adopted."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/stat") as file:
                fields = file.read().rsplit(") ", 1)[1].split()
        except (OSError, IndexError):
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z":
            found.append(int(pid))
    return found


def results(folder, identity):
    path = f"{folder}/r{identity}"
    if not os.path.exists(path):
        sys.exit(3)
    with open(path) as file:
        return file.read()


def shows(folder):
    """Whether the results are those of the finding."""
    if EVIDENCE == "Printed":
        with open(f"{folder}/printed") as file:
            return bool(file.read().strip())
    if EVIDENCE == "Damage":
        return os.path.exists(f"{folder}/damage")
    kind, value = next(iter(EVIDENCE.items())) if isinstance(EVIDENCE, dict) else (EVIDENCE, None)
    if kind == "Differ":
        return results(folder, value[0]["id"]) != results(folder, value[1]["id"])
    if kind == "AnyDiffer":
        return any(results(folder, one) != results(folder, other) for one, other in value)
    if kind == "Same":
        return all(results(folder, proof["id"]) == proof["observed"] for proof in value)
    if kind == "Grown":
        quantity, first, last, most = value
        one, two = (json.loads(results(folder, identity))[quantity] for identity in (first, last))
        return one != two if quantity == "Settings" else two - one > most
    return False


def main():
    global FOLDER, room_for_results
    FOLDER = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else ".")
    if len(sys.argv) > 3:
        room_for_results = sys.argv[3]
        phase(int(sys.argv[2]))
    if hasattr(libc, "prctl"):
        # Orphans become children of this process (PR_SET_CHILD_SUBREAPER).
        libc.prctl(36, 1)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(len(PHASES)):
            command = [sys.executable, os.path.abspath(__file__), FOLDER, str(number), folder]
            # Memory that was not written differs between the processes.
            settings = {"MALLOC_PERTURB_": str(1 + 90 * number), "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0"}
            environment = os.environ | settings
            process = subprocess.Popen(command, start_new_session=True, env=environment)
            try:
                status = process.wait(20)
            except subprocess.TimeoutExpired:
                say("the process does not end")
                process.kill()
                process.wait()
                status = 1
            if status:
                say(f"the process was ended by signal {-status}" if status < 0 else f"the process ended with exit status {status}")
                sys.exit(1 if EVIDENCE == "End" else 3)
        if descendants():
            time.sleep(0.3)
        left = descendants()
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        found = bool(left) if EVIDENCE == "Left" else shows(folder)
    say("The finding shows." if found else "The finding does not show.")
    sys.exit(int(found))
