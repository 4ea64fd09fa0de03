"""What a process that decodes gives up before it sees a file: network, programs, other processes, and all writing.

Linux only: `prctl(2)`, `landlock(7)` from kernel 5.13 on, and a filter of `seccomp(2)` on the processors named below.
None of it can be taken back, and threads and children inherit it. What was open stays open: the pipes to our parent.
Reading stays allowed, for Python imports modules while it works; nothing that is read can leave but by the answer.
"""

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Sequence

# include/uapi/linux/landlock.h: rights by the version (ABI) of the kernel's Landlock that knows them
_FILES = ((1, 0x1FFF & ~0b1100), (2, 1 << 13), (3, 1 << 14), (5, 1 << 15))
# All of the first but READ_FILE and READ_DIR, then REFER, TRUNCATE, IOCTL_DEV.
_TCP, _SCOPES = (4, 0b11), (6, 0b11)  # bind and connect; abstract Unix sockets, signals to other processes
_CREATE_RULESET, _RESTRICT_SELF = 444, 446  # the same on every processor
_ONLY_VERSION = 1
_NO_NEW_PRIVS, _SECCOMP, _FILTER = 38, 22, 2

# include/uapi/linux/audit.h, and asm/unistd.h: the processor's mark and its numbers of calls
_CALLS: dict[str, tuple[int, dict[str, int]]] = {
    "x86_64": (
        0xC000003E,
        {
            **{"socket": 41, "connect": 42, "sendto": 44, "sendmsg": 46, "bind": 49, "socketpair": 53, "sendmmsg": 307},
            **{"execve": 59, "execveat": 322, "ptrace": 101, "process_vm_readv": 310, "process_vm_writev": 311},
            **{"io_uring_setup": 425, "io_uring_enter": 426, "io_uring_register": 427, "bpf": 321, "kexec_load": 246},
            **{"mount": 165, "umount2": 166, "unshare": 272, "setns": 308, "keyctl": 250, "add_key": 248},
            **{"perf_event_open": 298, "userfaultfd": 323, "pidfd_open": 434, "pidfd_getfd": 438, "kill": 62},
        },
    ),
    "aarch64": (
        0xC00000B7,
        {
            **{"socket": 198, "connect": 203, "sendto": 206, "sendmsg": 211, "bind": 200, "socketpair": 199},
            **{"sendmmsg": 269, "execve": 221, "execveat": 281, "ptrace": 117, "process_vm_readv": 270},
            **{"process_vm_writev": 271, "io_uring_setup": 425, "io_uring_enter": 426, "io_uring_register": 427},
            **{"bpf": 280, "kexec_load": 104, "mount": 40, "umount2": 39, "unshare": 97, "setns": 268, "keyctl": 219},
            **{"add_key": 217, "perf_event_open": 241, "userfaultfd": 282, "pidfd_open": 434, "pidfd_getfd": 438},
            **{"kill": 129},
        },
    ),
}
"""What no decoder needs: the network, programs, other processes, and parts of the kernel that often had holes."""


def confine() -> list[str]:
    """Give up what is not needed; names of what held: ``privileges``, ``calls``, ``files``. Call it with one thread."""
    if sys.platform != "linux":
        return []
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    if libc.prctl(_NO_NEW_PRIVS, *map(ctypes.c_ulong, (1, 0, 0, 0))):
        return []  # without it neither of the others is allowed
    return ["privileges", *(["files"] if _landlock(libc) else []), *(["calls"] if _seccomp(libc) else [])]


def landlock_version() -> int:
    """The kernel's version of Landlock, 0 where there is none."""
    if sys.platform != "linux":
        return 0
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    return max(0, int(libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint(_ONLY_VERSION))))


def _landlock(libc: ctypes.CDLL) -> bool:
    """Deny files and TCP: rights that a ruleset handles and no rule gives back are gone."""
    version = landlock_version()
    if not version:
        return False
    files = sum(rights for since, rights in _FILES if version >= since)
    rules = struct.pack("=QQQ", files, *(rights if version >= since else 0 for since, rights in (_TCP, _SCOPES)))
    size = 8 if version < 4 else 16 if version < 6 else 24  # an older kernel takes no longer one
    ruleset = libc.syscall(_CREATE_RULESET, rules, ctypes.c_size_t(size), ctypes.c_uint(0))
    if ruleset < 0:
        return False
    held = bool(libc.syscall(_RESTRICT_SELF, ctypes.c_int(ruleset), ctypes.c_uint(0)) == 0)
    os.close(ruleset)
    return held


def _seccomp(libc: ctypes.CDLL) -> bool:
    """Let calls that no decoder needs fail with "Operation not permitted"."""
    if platform.machine() not in _CALLS:
        return False
    mark, calls = _CALLS[platform.machine()]
    program = filter_of(mark, sorted(calls.values()))
    kept = ctypes.create_string_buffer(program)
    program_struct = struct.pack("HL", len(program) // 8, ctypes.addressof(kept))  # sock_fprog, padded as C does
    return bool(
        libc.prctl(_SECCOMP, ctypes.c_ulong(_FILTER), program_struct, ctypes.c_ulong(0), ctypes.c_ulong(0)) == 0
    )


def filter_of(mark: int, calls: Sequence[int]) -> bytes:
    """The program (classic BPF) of `seccomp(2)` that refuses these calls, and all of another processor's kind."""
    load, equal, at_least, give = 0x20, 0x15, 0x35, 0x06  # BPF_LD|W|ABS, BPF_JMP|JEQ|K, BPF_JMP|JGE|K, BPF_RET|K
    allow, refuse = 0x7FFF0000, 0x00050000 | errno.EPERM
    last = len(calls) + 4  # the rows: mark, its test, number, x32's test, a test each, allow, refuse
    rows = [
        (load, 0, 0, 4),  # seccomp_data.arch
        (equal, 0, last - 1, mark),
        (load, 0, 0, 0),  # seccomp_data.nr
        (at_least, last - 3, 0, 0x40000000),  # x32's numbers would pass by the others
        *((equal, last - 4 - k, 0, call) for k, call in enumerate(calls)),
        (give, 0, 0, allow),
        (give, 0, 0, refuse),
    ]
    return b"".join(struct.pack("=HBBI", *row) for row in rows)
