"""Package definition, for pip and for colcon (ament_python)."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "simbev_ros"


def files(pattern: str) -> list[str]:
    """Paths relative to this file, as data_files wants them."""
    return sorted(str(path) for path in Path().glob(pattern))


setup(
    name=NAME,
    version="0.1.0",
    description="Random driving scenes as a ROS 2 graph, with sensors and exact bird's-eye-view ground truth",
    license="Apache-2.0",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "**/*.yaml", "**/*.glsl", "**/*.css"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", [*files("config/*.yaml"), *files("config/*.xml")]),
        (f"share/{NAME}/config/rigs", files("config/rigs/*.yaml")),
    ],
    install_requires=[
        "eclipse-sumo>=1.28",
        "libsumo>=1.28",
        "mapbox_earcut>=2.0",
        "mcap>=1.6",
        "moderngl>=5.12",
        "numpy>=1.26",
        "open3d-cpu>=0.19",
        "opencv-python-headless>=4.10",
        "av>=14",
        "pillow>=11.2",
        "pyarrow>=18",
        "pydantic>=2.10",
        "pyproj>=3.6",
        "pyyaml>=6.0",
        "rich>=13.9",
        "rosbags>=0.10",
        "scipy>=1.14",
        "shapely>=2.0",
        "simplejpeg>=1.8",
        "trimesh>=4.5",
        "typer>=0.15",
        "zlib-ng>=0.5",
        "zstandard>=0.23",
    ],
    extras_require={
        "wheels": ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"],
        "test": [
            "carla>=0.9.16; python_version < '3.13' and sys_platform == 'linux' and platform_machine == 'x86_64'",
            "mypy>=1.15",
            "pytest>=8.3",
            "ruff>=0.9",
            "types-PyYAML",
            "types-shapely",
        ],
    },
    entry_points={
        "console_scripts": [
            "simbev = simbev_ros.cli.main:main",
            "simbev_node = simbev_ros.nodes.main:main",
        ]
    },
    zip_safe=False,
)
