# simbev with all it needs, by the same set-up as on any machine: `docker build -t simbev .`
# docs/guide/container.md has the options of `docker run` that matter: --shm-size, --gpus, volumes.
# A digest pins the base: --build-arg BASE=debian:13-slim@sha256:…
ARG BASE=debian:13-slim
FROM ${BASE}

# Extras of setup.py, separated by commas; "cluster" adds Ray.
ARG EXTRAS=""
# More Python packages, separated by spaces: boto3, with which Ray starts nodes on AWS.
ARG PACKAGES=""
# The bill of materials of all Python packages, where and as scanners of images look for it.
ARG SBOM=/usr/local/share/sbom/simbev.cdx.json
LABEL io.github.simbev-ros.sbom="${SBOM}"

WORKDIR /opt/simbev

# What the set-up reads comes first, so that a change of any other file leaves the large layer as it is.
COPY simbev setup.py setup.cfg pyproject.toml package.xml README.md ./
COPY resource resource
COPY config config
COPY launch launch
COPY interfaces interfaces
COPY simbev_ros/__init__.py simbev_ros/
COPY exporters/pyproject.toml exporters/
COPY exporters/simbev_exporters/__init__.py exporters/simbev_exporters/
COPY simbev_ros/foundation/installation simbev_ros/foundation/installation

# The set-up makes ROS messages that have no wheels, with a compiler that is not needed afterwards.
# With Ray come the programs that those who start Ray in containers call there: wget, for the probes of older KubeRays;
# rsync, for files that `ray up` copies. Byte code is compiled here because the user below cannot write it.
RUN export PIP_NO_CACHE_DIR=1 DEBIAN_FRONTEND=noninteractive \
    && apt-get update && apt-get install -y --no-install-recommends g++ python3-dev \
    && if ! ./simbev setup "${EXTRAS}"; then cat .setup.log; exit 1; fi \
    && if [ -n "${PACKAGES}" ]; then .venv/bin/python -m pip install --no-compile ${PACKAGES}; fi \
    && case ",${EXTRAS}," in *,cluster,*) \
        .venv/bin/ray --version && ln -s /opt/simbev/.venv/bin/ray /usr/local/bin/ \
        && apt-get update && apt-get install -y --no-install-recommends rsync wget ;; esac \
    && mkdir -p "${SBOM%/*}" && ./simbev sbom >"${SBOM}" \
    && .venv/bin/python -W ignore -m compileall -q -j 0 .venv/lib \
    && apt-get purge -y --auto-remove g++ python3-dev \
    && apt-get clean && rm -rf .setup.log .setup.lock /var/lib/apt/lists/*

# How libEGL finds NVIDIA's library, which the container toolkit brings; without a GPU, libEGL passes on to Mesa's.
RUN mkdir -p /usr/share/glvnd/egl_vendor.d \
    && printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "libEGL_nvidia.so.0"}}\n' \
        >/usr/share/glvnd/egl_vendor.d/10_nvidia.json

# The number of the user that runs it: folders that are mounted for output must be writable by this user.
ARG UID=1000
COPY . .
RUN .venv/bin/python -m compileall -q -j 0 simbev_ros exporters \
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
