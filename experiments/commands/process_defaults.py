"""Process-wide defaults, set before torch and MLflow are imported: importing the room does it."""

import ctypes
import gc
import os
import platform

# mallopt(3): keep large blocks in the heap. By default glibc returns every large activation to the system and asks for it
# again, and the page faults cost up to a third of the training time of a convolutional network.
MALLOC_OPTIONS = {
    -3: 1 << 30,  # M_MMAP_THRESHOLD [bytes]
    -4: 0,  # M_MMAP_MAX
    -1: 2**31 - 1,  # M_TRIM_THRESHOLD [bytes]
    -2: 256 << 20,  # M_TOP_PAD [bytes]
}
# New objects between two searches for reference cycles. With Python's own number, 700, the searches take a third of the time
# in which torch is imported. What was imported stays, so the searches of a run pass over it.
COLLECT_EVERY_LOADING, COLLECT_EVERY = 1_000_000, 100_000
ENVIRONMENT = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "DO_NOT_TRACK": "true",  # MLflow does not understand "1" here
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",  # of every run, when it ends
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",  # its defaults are minutes; the tracker tries again later anyway
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",  # [s]
    "RL_WARNINGS": "0",  # torchrl's, about its optional C++ extension
    "RL_LOGGING_LEVEL": "WARNING",  # below, torchrl tells in colours what it allocates, in logs, too
    # OpenMP's threads sleep when they have nothing to do. By default they spin, and where other processes want the cores,
    # too, each waits for one that is not running: two threads were then 20 times slower than sleeping ones. GNU's, which
    # torch has, spin for a moment first, about as long as lies between two layers: 1.5 times as fast as sleeping at once.
    "OMP_WAIT_POLICY": "passive",
    "GOMP_SPINCOUNT": "20000",
}


def set_process_defaults(num_threads: int = 1) -> None:
    """Threads for torch, one unless said otherwise, so that runs side by side do not fight; and glibc's allocator tuned."""
    import torch

    if gc.get_freeze_count():  # in this process was another run, whose replay, gigabytes of frames, lies in a cycle
        gc.collect()
    else:
        gc.freeze()
    gc.set_threshold(COLLECT_EVERY, *gc.get_threshold()[1:])
    torch.set_num_threads(num_threads)
    if platform.libc_ver()[0] == "glibc":
        libc = ctypes.CDLL("libc.so.6")
        for option, value in MALLOC_OPTIONS.items():
            libc.mallopt(option, value)


for name, value in ENVIRONMENT.items():  # what the user has set stays
    os.environ.setdefault(name, value)
gc.set_threshold(COLLECT_EVERY_LOADING, *gc.get_threshold()[1:])
