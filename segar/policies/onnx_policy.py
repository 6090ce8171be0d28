"""Policies in ONNX files, as other frameworks export them, played by onnxruntime."""

from os import PathLike, devnull
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.policies.network_policy import Environments
from segar.support import content_of, file_limit, need

ELSEWHERE = "session.model_external_initializers_file_folder_path"
MEMORY = 2 * 2**30  # [bytes] of all numbers that models may compute at a time, unless SEGAR_FILE_LIMIT says another
DRAWS = "its draws are others each time it is played, so export the action without noise"
REFUSED = {"Loop": "a Loop may never end, so write its steps out"} | dict.fromkeys(
    ("RandomNormal", "RandomUniform", "Multinomial", "Bernoulli"), DRAWS
)
DTYPES = {"tensor(float)": np.dtype(np.float32), "tensor(uint8)": np.dtype(np.uint8)}


class OnnxPolicy:
    """Actions for observations, by the model in an ONNX file; what :func:`segar.evaluate_policy` plays.

    The first input is an observation, float32 or uint8 ``(n, ...)``, and the first output the action, float32 ``(n,
    components)`` in the range of the task. A second input and a second output, float32 ``(n, numbers)``, are a memory, which is
    zero where episodes begin. The number ``n`` of environments is free. Nothing is read but the file, and nothing in it is
    Python code; what it computes may take 2 GiB, and neither loops nor draws. The last bits of what onnxruntime computes may
    differ between processors.

    Args:
        path: of the file.

    Raises:
        SegarError: onnxruntime is not installed, or the file is no such model; the message names the input or output.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        need("a policy in an ONNX file", "onnxruntime")
        import onnxruntime

        self.path = Path(path)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4  # what goes wrong is an error, and told by it
        options.add_session_config_entry(ELSEWHERE, devnull)  # so that weights in other files are not found
        arena = onnxruntime.OrtArenaCfg({"max_mem": file_limit(MEMORY), "arena_extend_strategy": 1})
        of_processor = (onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, onnxruntime.OrtMemType.DEFAULT)
        onnxruntime.create_and_register_allocator(onnxruntime.OrtMemoryInfo("Cpu", *of_processor), arena)
        options.add_session_config_entry("session.use_env_allocators", "1")
        content = content_of(self.path, "ONNX file", SegarError)
        for word, why in REFUSED.items():
            if word.encode() in content:
                raise self._misfit(f"it has a {word}, or a name with this word; {why}")
        try:
            self._session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # those of onnxruntime have nothing else in common
            raise SegarError(f"{self.path} is no ONNX model that can be played: {error}") from error
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        if not 1 <= len(inputs) == len(outputs) <= 2:
            raise self._misfit(
                f"it has {len(inputs)} inputs and {len(outputs)} outputs; there must be an observation and an action, and a"
                " memory beside both or neither"
            )
        for one in (*inputs, *outputs):
            known = [*DTYPES][: 2 if one is inputs[0] else 1]
            free = [axis for axis, size in enumerate(one.shape) if not isinstance(size, int)]
            if one.type not in known or len(one.shape) < 2 or 0 not in free or (one in inputs and free != [0]):
                raise self._misfit(
                    f"'{one.name}' is {one.type} of shape {one.shape}; it must be {' or '.join(known)} of shape (n, ...), where"
                    " any n will do: export it with a dynamic first axis, and no other one of an input"
                )
        self._names = [one.name for one in inputs]
        self.dtype, self.observation_shape = DTYPES[inputs[0].type], tuple(inputs[0].shape[1:])
        self._width = inputs[1].shape[1] if len(inputs) == 2 else 0
        self._memory = np.zeros((0, self._width), np.float32)

    def begin(self, env: Environments) -> None:
        """Forget the past, because episodes start in ``env``."""
        self._memory = np.zeros((env.num_envs, self._width), np.float32)

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        """Actions float32 ``(n, components)``; raises :class:`SegarError` for observations that the model does not read."""
        shape = observations.shape[1:] if isinstance(observations, np.ndarray) else None
        if shape != self.observation_shape or observations.dtype != self.dtype:
            given = type(observations).__name__ if shape is None else f"{observations.dtype} of shape (n, *{shape})"
            raise self._misfit(
                f"it reads observations {self.dtype} of shape (n, *{self.observation_shape}), not {given}"
            )
        if self._width and len(self._memory) != len(observations):
            raise self._misfit(
                f"it has a memory of {len(self._memory)} environments, and cannot be played with {len(observations)}"
                " environments: call begin(env) where episodes start, and then give it the observations of all of them"
            )
        try:
            found: Any = self._session.run(None, dict(zip(self._names, (observations, self._memory), strict=False)))
        except Exception as error:  # as above
            raise self._misfit(f"it cannot be played with {len(observations)} environments: {error}") from error
        if self._width:
            self._memory = found[1]
        return found[0]

    def _misfit(self, problem: str) -> SegarError:
        return SegarError(f"{self.path}: {problem}")
