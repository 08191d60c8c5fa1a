"""Diagnosis: what the simulation gets wrong in a recording, and why. `raccoon diagnose` is its command line.

From Python::

    from raccoon.diagnose.recordings.diagnosis import diagnose_recording
    from raccoon.trace.loading import load_run

    run = load_run("run.jsonl.gz")  # a trace, CSV, MCAP or EMPS file
    found = diagnose_recording(run.recording.columns, run.robot, device=run.recording.device)
    for cause in found.causes:
        print(cause.name, cause.probability, cause.parameters)

Columns are in the units of docs/trace-format.md (SI, duty as a share of the battery -1..1). `run.robot` is
None if the recording does not describe its robot: then load one (`raccoon.load_robot`). The result is a
`raccoon.diagnose.result.Diagnosis`. Raises TraceError for a recording that cannot be used. Without numba a
drive takes hours. docs/diagnosis.md describes the method, docs/architecture.md the order in which to read the
package.
"""
