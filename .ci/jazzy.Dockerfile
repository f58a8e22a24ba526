# What .ci/jazzy runs in: ROS 2 Jazzy as its users install it, with RViz, and all that simbev needs besides.
FROM ros:jazzy

# Versions are those of the distribution; Xvfb and ImageMagick take the picture of RViz.
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        imagemagick \
        ros-jazzy-image-transport-plugins \
        ros-jazzy-rviz2 \
        ros-jazzy-vision-msgs \
        xauth \
        xvfb \
    && rm -rf /var/lib/apt/lists/*

# What the set-up reads, as in Dockerfile; .ci/jazzy lays the rest of the checkout beside it.
WORKDIR /workspace/src/simbev_ros
COPY simbev setup.py setup.cfg pyproject.toml package.xml README.md ./
COPY resource resource
COPY config config
COPY launch launch
COPY interfaces interfaces
COPY simbev_ros/__init__.py simbev_ros/
COPY exporters/pyproject.toml exporters/
COPY exporters/simbev_exporters/__init__.py exporters/simbev_exporters/
COPY simbev_ros/foundation/installation simbev_ros/foundation/installation
RUN bash -c 'source /opt/ros/jazzy/setup.bash && { PIP_NO_CACHE_DIR=1 ./simbev setup || { cat .setup.log; exit 1; }; }' \
    && rm -rf .setup.log .setup.lock /var/lib/apt/lists/*

CMD ["/source/.ci/jazzy", "inside"]
