"""The action that starts a node; the command ends with ROS's arguments, as the real one's does."""

from collections.abc import Iterable
from typing import Any

from launch.actions import ExecuteProcess, Words


class Node(ExecuteProcess):
    """Starts a program of a package."""

    def __init__(
        self,
        *,
        executable: Words,
        package: Words,
        name: str | None = None,
        namespace: Words | None = None,
        parameters: Iterable[dict[str, Any]] | None = None,
        remappings: Iterable[tuple[str, str]] | None = None,
        arguments: Iterable[Words] | None = None,
        **options: Any,
    ) -> None:
        of_ros = [] if name is None else ["-r", f"__node:={name}"]
        of_ros += [] if namespace is None else ["-r", f"__ns:={namespace}"]
        given = [(key, value) for each in parameters or () for key, value in each.items()]
        of_ros += [word for key, value in given for word in ("-p", f"{key}:={str(value).lower()}")]
        of_ros += [word for old, new in remappings or () for word in ("-r", f"{old}:={new}")]
        self.package, self.executable = package, executable
        super().__init__(cmd=[f"{package}/{executable}", *(arguments or ()), "--ros-args", *of_ros], **options)
