"""Many runs: sweep, reproduction and leaderboard; which jobs there are, which are missing, and tables over all.

A study that was killed is resumed by the same command; `jobs` says how.
What cannot be used raises `ConfigError`; a study whose jobs fail raises `JobFailedError`.
Others may import `sweep`, `reproduce`, `leaderboard`, `leaderboard_plan` and `jobs`.
"""
