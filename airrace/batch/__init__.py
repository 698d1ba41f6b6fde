"""Batches of many courses: what is to be flown, by whom, what of it is done already, and what came of it.

    sources -> sweep, naming -> plan --- jobs ---> supervision <--- events --- an executor (local.py, cluster.py)
                                 ^                     |
                                 +----- records <------+------> reports

A `Job` is plain data and complete in itself: it can travel. `supervision.py` decides what runs, runs again or is kept,
and writes the records; it knows nothing of processes. An `Executor` flies jobs, somewhere; it knows nothing of records.

**Another executor** is one class with the methods of `executor.Executor`. What it may rely on and what it owes is said
there. Where it has a machine to run a job on, `process.JobProcess` is the whole run of one job there, in a process of
its own and with its time limit. That needs a folder to write to, and nothing else of the machine that planned the job.
"""
