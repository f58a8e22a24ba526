"""Actions; each takes only the keyword arguments that the real one takes."""

from collections.abc import Callable, Iterable
from typing import Any

from launch import LaunchContext
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, text

Words = str | LaunchConfiguration


class Action:
    """Base of all actions."""

    def __init__(self, *, condition: Any = None) -> None:
        self.condition = condition

    def execute(self, context: LaunchContext) -> "list[Action] | None":
        """Do it; return further actions."""
        raise NotImplementedError


class DeclareLaunchArgument(Action):
    """Declares an argument; without a default it must be given."""

    def __init__(
        self,
        name: str,
        *,
        default_value: str | None = None,
        description: str | None = None,
        choices: Iterable[str] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        assert default_value is None or isinstance(default_value, str)
        self.name, self.default_value, self.description = name, default_value, description
        self.choices = None if choices is None else list(choices)
        assert default_value is None or self.choices is None or default_value in self.choices

    def execute(self, context: LaunchContext) -> None:
        """Take the default unless a value is given."""
        context.declared[self.name] = self
        if self.name not in context.launch_configurations:
            if self.default_value is None:
                raise RuntimeError(f"Required launch argument '{self.name}' was not provided")
            context.launch_configurations[self.name] = self.default_value
        value = context.launch_configurations[self.name]
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f"Argument '{self.name}' provided value '{value}' is not valid")


class OpaqueFunction(Action):
    """Calls a function with the context."""

    def __init__(self, *, function: Callable[[LaunchContext], "list[Action] | None"], **options: Any) -> None:
        super().__init__(**options)
        self._function = function

    def execute(self, context: LaunchContext) -> "list[Action] | None":
        """Call it."""
        return self._function(context)


class SetEnvironmentVariable(Action):
    """Sets a variable for the processes that follow."""

    def __init__(self, name: Words, value: Words, **options: Any) -> None:
        super().__init__(**options)
        self._name, self._value = name, value

    def execute(self, context: LaunchContext) -> None:
        """Set it."""
        context.environment[text(self._name, context)] = text(self._value, context)


class Shutdown(Action):
    """Ends everything."""

    def __init__(self, *, reason: str = "", **options: Any) -> None:
        super().__init__(**options)
        self.reason = reason


class IncludeLaunchDescription(Action):
    """Includes another launch file, with arguments."""

    def __init__(
        self,
        launch_description_source: PythonLaunchDescriptionSource,
        *,
        launch_arguments: Iterable[tuple[str, Words]] = (),
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._source, self._arguments = launch_description_source, list(launch_arguments)

    def execute(self, context: LaunchContext) -> None:
        """Execute the other description with these arguments."""
        for name, value in self._arguments:
            context.launch_configurations[name] = text(value, context)
        self._source.load().execute(context)


class ExecuteProcess(Action):
    """Starts a process."""

    def __init__(
        self,
        *,
        cmd: Iterable[Words],
        name: str | None = None,
        output: str = "log",
        sigterm_timeout: Words = "5",
        sigkill_timeout: Words = "5",
        on_exit: Any = None,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._cmd, self.name, self.on_exit = list(cmd), name, on_exit
        self.patience_s = float(str(sigterm_timeout)), float(str(sigkill_timeout))
        self.command: list[str] = []
        self.environment: dict[str, str] = {}

    def execute(self, context: LaunchContext) -> None:
        """Note its command and its variables."""
        self.command = [text(word, context) for word in self._cmd]
        self.environment = dict(context.environment)
        context.processes.append(self)
