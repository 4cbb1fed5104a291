"""Who comes first where processors are short: the browser, the page, and only then the simulation."""

import os
import sys
import threading

NICE = 5  # of the threads that simulate; 0 is usual, 19 the most patient
WORKER = "turnbuckle"  # name of the threads that help with a step (`turnbuckle.compute.program`)


def give_way() -> None:
    """Lower the priority of the calling thread and of those that help it. On Linux alone, where threads have their own.

    Without it a simulation that cannot keep up takes all processors, and a browser on the same machine that draws
    without a graphics card gets to draw a few frames a second.
    """
    if not sys.platform.startswith("linux"):
        return
    me = threading.current_thread()
    for thread in threading.enumerate():
        if thread.native_id is not None and (thread is me or thread.name == WORKER):
            try:
                if os.getpriority(os.PRIO_PROCESS, thread.native_id) < NICE:
                    os.setpriority(os.PRIO_PROCESS, thread.native_id, NICE)
            except OSError:
                pass  # a thread that has just ended
