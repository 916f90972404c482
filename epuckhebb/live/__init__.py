"""A live world in the browser: robots that someone disturbs while they run, and the run that repeats it.

`world` holds the robots and what is done to them, `engine` runs them at a pace, `server` lets one page of this machine
see and disturb them, `page` is that page.
Others may import `server`.
What cannot be played raises `ConfigError`; what a page wishes and cannot be is refused with a sentence.
"""
