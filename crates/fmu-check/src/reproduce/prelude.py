import ctypes
import mmap
import os
import struct
import subprocess
import sys
import tempfile
import threading
from ctypes import c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p

libc = ctypes.CDLL(None)
libc.mmap.restype = c_void_p
libc.mmap.argtypes = [c_void_p, c_size_t, c_int, c_int, c_int, ctypes.c_long]
libc.mprotect.argtypes = [c_void_p, c_size_t, c_int]
library = None


def guarded(content):
    """The address of an array that ends where memory ends: what is read or written beyond it is a crash."""
    page = mmap.PAGESIZE
    length = ((len(content) + page - 1) // page + 1) * page
    flags = mmap.MAP_SHARED | mmap.MAP_ANONYMOUS
    begin = libc.mmap(None, length, mmap.PROT_READ | mmap.PROT_WRITE, flags, -1, 0)
    libc.mprotect(begin + length - page, page, 0)
    address = begin + length - page - len(content)
    ctypes.memmove(address, content, len(content))
    return address


def room(size):
    return guarded(b"\x5a" * size)


def pointers(addresses):
    return guarded(struct.pack(f"{len(addresses)}P", *addresses))


def text(content):
    return None if content is None else guarded(content + b"\0")


def call(name, *arguments, result=c_int, show=()):
    """Calls a function, and prints its status and what it wrote: (address, format of struct, count)."""
    function = library[name]
    function.restype = result
    answer = function(*arguments)
    print(f"{name}: {answer}", end="")
    for address, kind, count in show:
        values = struct.unpack(f"{count}{kind}", ctypes.string_at(address, count * struct.calcsize(kind)))
        if kind == "P":
            values = [ctypes.string_at(value) if value else None for value in values]
        print(" ->", *map(repr, values), end="")
    print(flush=True)
    return answer


def word(address):
    return ctypes.c_size_t.from_address(address).value


Logger2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
Logger3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
say2 = Logger2(lambda _, name, status, category, message: print("    log:", status, category, message))
say3 = Logger3(lambda _, status, category, message: print("    log:", status, category, message))


class Callbacks(ctypes.Structure):
    _fields_ = [("logger", Logger2), ("allocate", c_void_p), ("free", c_void_p), ("finished", c_void_p), ("own", c_void_p)]


def address_of(function):
    return ctypes.cast(function, c_void_p).value


callbacks = Callbacks(say2, address_of(libc.calloc), address_of(libc.free), None, None)


def measure():
    with open("/proc/self/statm") as file:
        print("resident memory:", int(file.read().split()[1]) * mmap.PAGESIZE, "bytes", flush=True)


def run(phases, path):
    """Each phase in a process of its own, so that a crash does not end this one."""
    global library
    if len(sys.argv) > 3:
        library = ctypes.CDLL(path)
        for slot in saved:
            name = f"{sys.argv[3]}/{slot}"
            if os.path.exists(name):
                with open(name, "rb") as file:
                    content = file.read()
                ctypes.memmove(saved[slot], content, len(content))
                ctypes.c_size_t.from_address(sizes[slot]).value = len(content)
        phases[int(sys.argv[2])]()
        for slot in saved:
            with open(f"{sys.argv[3]}/{slot}", "wb") as file:
                file.write(ctypes.string_at(saved[slot], word(sizes[slot])))
        sys.stdout.flush()
        os._exit(0)
    with tempfile.TemporaryDirectory() as passed_on:
        for number in range(len(phases)):
            status = subprocess.run([sys.executable, __file__, folder, str(number), passed_on]).returncode
            if status < 0:
                sys.exit(f"the process was ended by signal {-status}")
            if status:
                sys.exit(f"the process ended with exit status {status}")
