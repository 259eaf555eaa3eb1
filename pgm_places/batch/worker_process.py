"""What a worker process sets up for itself before its first task."""

import gc
import os
import signal
import threading
import time


def start_worker(memory_bytes: int | None) -> None:
    """Prepare this process: it ends with its parent, and takes no more memory than it may."""
    # Ctrl-C reaches the whole group of processes; the parent ends its workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    gc.set_threshold(100_000, 50, 50)  # as on the command line
    if memory_bytes is not None:
        limit_memory(memory_bytes)


def end_with_parent() -> None:
    """End this process when the one that started it is gone, however that ended."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def limit_memory(n_bytes: int) -> None:
    """Let allocations fail beyond this many bytes, where the system can do that.

    Private memory that can be written to is counted, as Linux does for ``RLIMIT_DATA``: address
    space that libraries reserve and never use is not.
    """
    try:
        import resource
    except ImportError:  # Windows
        return
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    if most != resource.RLIM_INFINITY:
        n_bytes = min(n_bytes, most)
    resource.setrlimit(resource.RLIMIT_DATA, (n_bytes, most))
