"""Many runs: sweep, reproduction and leaderboard; which jobs there are, which are missing, and tables over all.

A study that was killed is resumed by the same command; `jobs` says how. Others import `sweep`, `reproduce`,
`leaderboard`, `leaderboard_plan`, `flock` and `jobs`, one at a time: each loads only what it needs.
What cannot be used raises `ConfigError`; a study whose jobs fail raises `JobFailedError`.
"""
