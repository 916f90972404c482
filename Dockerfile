# The line of README.md that sets all up and runs the main job, in a container:
#
#   docker build --tag epuckhebb .
#   docker run --rm epuckhebb
#   docker run --rm --volume ./runs:/home/robot/epuckhebb/runs epuckhebb evolve seed=7
#
# The image holds the compiled kernels of the paper's rule. The folder `runs` must be writable for user 1000.
FROM python:3.13-slim

RUN useradd --create-home --uid 1000 robot
USER robot
ENV PATH="/home/robot/.local/bin:$PATH"
WORKDIR /home/robot/epuckhebb
COPY --chown=robot . .

RUN python -m pip install -e .
RUN epuckhebb evaluate scenario=lowlight

ENTRYPOINT ["epuckhebb"]
CMD ["evaluate", "scenario=lowlight"]
