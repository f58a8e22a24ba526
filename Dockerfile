# simbev with all it needs, by the same set-up as on any machine: `docker build -t simbev .`
# docs/guide/container.md has the options of `docker run` that matter: --shm-size, --gpus, volumes.
ARG BASE=debian:13-slim
FROM ${BASE}

# Extras of setup.py, separated by commas; "cluster" adds Ray.
ARG EXTRAS=""
# More Python packages, separated by spaces: boto3, with which Ray starts nodes on AWS.
ARG PACKAGES=""
# The user that runs it. Folders that are mounted for output must be writable by this number.
ARG UID=1000

WORKDIR /opt/simbev
SHELL ["/bin/bash", "-euo", "pipefail", "-c"]

# What the set-up reads comes first, so that a change of any other file leaves the large layer as it is.
COPY simbev setup.py setup.cfg pyproject.toml package.xml README.md ./
COPY resource resource
COPY config config
COPY simbev_ros/__init__.py simbev_ros/
COPY simbev_ros/installation simbev_ros/installation

# With Ray come the tools that those who start Ray in containers call there: wget, for probes of KubeRay before 1.6;
# rsync, for files that `ray up` copies. Byte code is compiled here because the user below cannot write it.
RUN export PIP_NO_CACHE_DIR=1 DEBIAN_FRONTEND=noninteractive \
    && if ! ./simbev setup; then cat .setup.log; exit 1; fi \
    && if [[ -n "${EXTRAS}${PACKAGES}" ]]; then \
        .venv/bin/python -m pip install --no-compile -e ".${EXTRAS:+[${EXTRAS}]}" ${PACKAGES}; fi \
    && if [[ ",${EXTRAS}," == *,cluster,* ]]; then \
        apt-get install -y --no-install-recommends rsync wget && ln -s /opt/simbev/.venv/bin/ray /usr/local/bin/; fi \
    && .venv/bin/python -W ignore -m compileall -q -j 0 .venv/lib \
    && apt-get clean && rm -rf .setup.log .setup.lock /var/lib/apt/lists/*

COPY . .
RUN .venv/bin/python -m compileall -q -j 0 simbev_ros \
    && ln -s /opt/simbev/simbev /usr/local/bin/ \
    && useradd --uid "${UID}" --create-home simbev \
    && chmod 1777 /home/simbev

# Without "graphics", NVIDIA's container toolkit leaves its EGL library out, and cameras render on the CPU.
ENV HOME=/home/simbev \
    NVIDIA_DRIVER_CAPABILITIES=compute,graphics,utility \
    NVIDIA_VISIBLE_DEVICES=all
USER simbev
WORKDIR /home/simbev
ENTRYPOINT ["simbev"]
CMD ["--help"]
