"""Many runs: sweep, reproduction, leaderboard, flocks, and studies of a user's own.

`study.py` says what a study is and conducts it; `jobs.py`, the engine, does its jobs on any launcher and resumes them.
`flock`, `leaderboard`, `reproduce` and `sweep` are the studies of the program, each with a function `plan`. Others
import these six, one at a time: each loads only what it needs. What cannot be used raises `ConfigError`; a study whose
jobs fail raises `JobFailedError`.
"""
