"""A live world in the browser: robots that someone disturbs while they run, and the run that repeats it.

`world` holds the robots of a maze and their changes, `flock` those of a plane; `server` runs them in real time or
faster and serves one page of this machine, `page` is that page. Others may import `server`. A setting that cannot be
played raises `ConfigError`; a change that cannot be made is refused with a sentence in the page.
"""
