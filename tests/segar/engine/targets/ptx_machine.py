"""A machine that executes PTX text on this processor, thread after thread: it tests kernels of GPUs where there is none.

Each instruction becomes LLVM IR for what the PTX manual (ISA 7.0) says that it does; LLVM compiles that for this processor.
What the machine does not know is an error that names the line. Memory of the thread's own is filled with a pattern before
each thread, so that a kernel that reads what it never wrote gives other results than it should.
"""

import ctypes
import platform
import re
from collections.abc import Sequence
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np

UNWRITTEN = 0xA5  # the byte that fills memory of a thread's own
WIDTHS = {"pred": 1, **{f"{kind}{bits}": bits for kind in "bus" for bits in (8, 16, 32, 64)}, "f32": 32, "f64": 64}
SPECIAL = {f"%{name}.x": f"%{name}" for name in ("tid", "ntid", "ctaid", "nctaid")}
FLOATS = {"f32": "float", "f64": "double"}
ORDERED = {"lt": "olt", "le": "ole", "gt": "ogt", "ge": "oge", "eq": "oeq", "ne": "one", "num": "ord", "nan": "uno"}
UNORDERED = {f"{name}u": f"u{code[1:]}" for name, code in ORDERED.items() if code[0] == "o" and name not in ("num",)}
ROUNDED = {"rni": "roundeven", "rmi": "floor", "rpi": "ceil", "rzi": "trunc"}
ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}


class UnknownPTX(Exception):
    """Something that the machine does not know."""


class PTXMachine:
    """The kernels of a PTX text, to be launched on arrays in this process's memory.

    Attributes:
        kernels: how many arguments each kernel has, by name.
    """

    def __init__(self, text: str) -> None:
        self.kernels: dict[str, int] = {}
        ir, self._local = _Translation(text, self.kernels).result()
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        features = (
            "+sse4.1" if platform.machine() in ("x86_64", "AMD64") else ""
        )  # rounding as instructions, and no fma
        machine = llvm.Target.from_default_triple().create_target_machine(cpu="", features=features, opt=1)
        module = llvm.parse_assembly(ir)
        module.verify()
        builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=1))
        builder.getModulePassManager().run(module, builder)
        self._engine = llvm.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()

    def launch(self, name: str, blocks: int, threads: int, arguments: Sequence[Any]) -> None:
        """Run a kernel: arrays are given as such, and must be contiguous in any order; numbers as int, bool or float."""
        if len(arguments) != self.kernels[name]:
            raise TypeError(f"{name} has {self.kernels[name]} arguments, not {len(arguments)}")
        self.launch_words(name, blocks, threads, np.array([word_of(one) for one in arguments], np.uint64))

    def launch_words(self, name: str, blocks: int, threads: int, words: np.ndarray) -> None:
        """Run a kernel on arguments as it has them, uint64 ``(arguments,)``."""
        run = ctypes.CFUNCTYPE(None, *[ctypes.c_uint64] * 4)(self._engine.get_function_address(f"run {name}"))
        own = np.full(max(self._local[name], 1) + 16, UNWRITTEN, np.uint8)
        run(blocks, threads, words.ctypes.data, -(-own.ctypes.data // 16) * 16)


@cache
def machine_of(text: str) -> PTXMachine:
    """The machine of a text, which is translated once: it keeps nothing between launches."""
    return PTXMachine(text)


def word_of(value: Any) -> int:
    """The eight bytes of an argument as a whole number."""
    if isinstance(value, np.ndarray):
        assert value.flags.c_contiguous or value.flags.f_contiguous
        return value.ctypes.data
    if isinstance(value, (float, np.floating)):
        return int(np.float64(value).view(np.uint64))
    return int(value) & (2**64 - 1)


class _Translation:
    """PTX text as LLVM IR."""

    def __init__(self, text: str, kernels: dict[str, int]) -> None:
        self.text, self.kernels = text, kernels
        self.lines: list[str] = []
        self.code: list[str] = []
        self.globals: dict[str, str] = {}
        self.local: dict[str, int] = {}
        self.count = 0
        self.number = 0

    def result(self) -> tuple[str, dict[str, int]]:
        """The IR, and how many bytes of its own each kernel needs."""
        head = []
        body: list[tuple[int, str]] = []
        name, parameters = "", 0
        inside = False
        for number, raw in enumerate(self.text.splitlines(), 1):
            self.number = number
            line = re.sub(r"//.*", "", raw).strip()
            if inside:
                if line == "}":
                    self.kernel(name, parameters, body)
                    inside, body, name = False, [], ""
                elif line:
                    body.append((self.number, line))
            elif line.startswith(".global"):
                head.append(self.constant(line))
            elif match := re.fullmatch(r"\.visible \.entry ([\w$]+)\(", line):
                name, parameters = match[1], 0
            elif name and re.fullmatch(r"\.param \.(u64|b64|f64)( \.ptr \.global \.align \d+)? [\w$]+,?", line):
                parameters += 1
            elif name and line == "{":
                inside = True
            elif (name and line == ")") or re.match(r"(\.version|\.target|\.address_size)\b", line) or not line:
                pass
            else:
                self.unknown(line)
        needed = sorted(set(re.findall(r"@(llvm\.[\w.]+)\(", "\n".join(self.lines))))
        return "\n".join([*head, *self.lines, *map(declaration, needed)]), self.local

    def constant(self, line: str) -> str:
        """A table in the GPU's memory."""
        match = re.fullmatch(r"\.global \.align (\d+) \.b8 ([\w$]+)\[(\d+)\](?: = \{(.*)\})?;", line)
        if match is None:
            self.unknown(line)
        values = [int(v) for v in match[4].split(",")] if match[4] else []
        values += [0] * (int(match[3]) - len(values))
        self.globals[match[2]] = f"@g{len(self.globals)}"
        listed = ", ".join(f"i8 {value}" for value in values)
        return f"{self.globals[match[2]]} = internal global [{len(values)} x i8] [{listed}], align {match[1]}"

    def kernel(self, name: str, parameters: int, body: list[tuple[int, str]]) -> None:
        """The function that runs a kernel's threads, and the one that runs a thread."""
        self.kernels[name], self.local[name] = parameters, 0
        self.registers: dict[str, tuple[str, int]] = {}
        self.name, self.depots = name, dict[str, int]()
        self.code = []
        ends, table = False, ""
        self.tables: dict[str, list[str]] = {}
        for number, line in body:
            self.number = number
            if table:
                self.tables[table].append(line.rstrip(",;"))
                table = "" if line.endswith(";") else table
            elif match := re.fullmatch(r"([\w$]+): \.branchtargets", line):
                table = match[1]
                self.tables[table] = []
            elif line.startswith((".reg", ".local")):
                self.declare(line)
            elif match := re.fullmatch(r"([\w$]+):", line):
                if not ends:
                    self.emit(f'br label %"{match[1]}"')
                self.code.append(f'"{match[1]}":')
                ends = False
            elif line != '.pragma "nounroll";':
                ends = self.instruction(line)
        size = -(-self.local[name] // 16) * 16
        allocated = [f"{alloca} = alloca i{width}" for alloca, width in self.registers.values()]
        signature = "i32 %tid, i32 %ntid, i32 %ctaid, i32 %nctaid, ptr %words, i64 %own"
        clear = (
            [
                "%start = inttoptr i64 %own to ptr",
                f"call void @llvm.memset.p0.i64(ptr %start, i8 {UNWRITTEN}, i64 {size}, i1 false)",
            ]
            if size
            else []
        )
        self.lines += [f'define internal void @"thread {name}"({signature}) {{', *allocated, *clear, *self.code, "}"]
        self.lines += LOOP.replace("NAME", name).splitlines()

    def declare(self, line: str) -> None:
        """Registers, or memory of the thread's own."""
        if match := re.fullmatch(r"\.reg \.(\w+)\s+(%[\w$]+)(?:<(\d+)>)?;", line):
            names = [f"{match[2]}{k}" for k in range(int(match[3]))] if match[3] else [match[2]]
            for name in names:
                self.registers[name] = f"%r{len(self.registers)}", WIDTHS[match[1]]
        elif match := re.fullmatch(r"\.local \.align (\d+) \.b8\s+([\w$]+)\[(\d+)\];", line):
            at = -(-self.local[self.name] // 16) * 16
            self.depots[match[2]] = at
            self.local[self.name] = at + int(match[3])
        else:
            self.unknown(line)

    def emit(self, text: str) -> None:
        self.code.append(f"  {text}")

    def new(self, text: str) -> str:
        """The name of the value that the IR computes."""
        self.count += 1
        self.emit(f"%v{self.count} = {text}")
        return f"%v{self.count}"

    def unknown(self, line: str) -> Any:
        raise UnknownPTX(f"line {self.number}: {line}")

    def get(self, operand: str, width: int) -> str:
        """The bits of an operand."""
        if operand in self.registers:
            place, own = self.registers[operand]
            value = self.new(f"load i{own}, ptr {place}")
            if own == width:
                return value
            return self.new(f"{'trunc' if own > width else 'zext'} i{own} {value} to i{width}")
        if operand in SPECIAL:
            return SPECIAL[operand] if width == 32 else self.new(f"zext i32 {SPECIAL[operand]} to i{width}")
        if match := re.fullmatch(r"0[df]([0-9a-fA-F]+)", operand):
            return str(int(match[1], 16))
        if re.fullmatch(r"-?\d+", operand) or re.fullmatch(r"0x[0-9A-Fa-f]+U?", operand):
            return str(int(operand.rstrip("U"), 0) & (2**width - 1))
        if operand in self.depots:
            return self.new(f"add i64 %own, {self.depots[operand]}")
        if operand in self.globals:
            return self.new(f"ptrtoint ptr {self.globals[operand]} to i64")
        return self.unknown(operand)

    def put(self, register: str, value: str, width: int, signed: bool = False) -> None:
        """Write bits to a register, which may be wider."""
        if register not in self.registers:
            self.unknown(register)
        place, own = self.registers[register]
        if own > width:
            value = self.new(f"{'sext' if signed else 'zext'} i{width} {value} to i{own}")
        elif own < width:
            self.unknown(f"{width} bits in {register}")
        self.emit(f"store i{own} {value}, ptr {place}")

    def number_of(self, operand: str, kind: str) -> str:
        """The floating-point number that an operand is."""
        return self.new(f"bitcast i{WIDTHS[kind]} {self.get(operand, WIDTHS[kind])} to {FLOATS[kind]}")

    def put_number(self, register: str, value: str, kind: str) -> None:
        self.put(register, self.new(f"bitcast {FLOATS[kind]} {value} to i{WIDTHS[kind]}"), WIDTHS[kind])

    def address(self, operand: str) -> str:
        """The pointer of ``[register+offset]``."""
        match = re.fullmatch(r"\[([%\w$]+)(?:\+(-?\d+))?\]", operand)
        if match is None:
            return self.unknown(operand)
        whole = self.get(match[1], 64)
        if match[2]:
            whole = self.new(f"add i64 {whole}, {match[2]}")
        return self.new(f"inttoptr i64 {whole} to ptr")

    def instruction(self, line: str) -> bool:
        """Translate an instruction; returns whether nothing comes after it."""
        match = re.fullmatch(r"(?:@(!?)(%\w+)\s+)?([a-z][\w.:]*)(?:\s+(.*))?;", line)
        if match is None:
            self.unknown(line)
        negated, predicate, code, rest = match.groups()
        operands = re.findall(r"\{[^}]*\}|\[[^\]]*\]|[^,\s]+", rest or "")
        parts = code.split(".")
        label = ""
        if predicate:
            self.count += 1
            label, test = f"after{self.count}", self.get(predicate, 1)
            if negated:
                test = self.new(f"xor i1 {test}, true")
            if parts[0] == "bra":
                self.emit(f'br i1 {test}, label %"{operands[0]}", label %{label}')
                self.code.append(f"{label}:")
                return False
            self.emit(f"br i1 {test}, label %do{self.count}, label %{label}")
            self.code.append(f"do{self.count}:")
        if code == "brx.idx" and not label:
            index, table = operands
            cases = " ".join(f'i32 {k}, label %"{to}"' for k, to in enumerate(self.tables[table]))
            chosen = self.get(index, 32)
            self.emit(f"switch i32 {chosen}, label %none{self.count} [{cases}]")
            self.code.append(f"none{self.count}:")
            self.emit("call void @llvm.trap()")
            self.emit("unreachable")
            return True
        if parts[0] in ("bra", "ret", "exit") and len(parts) == (2 if parts[-1] == "uni" else 1):
            self.emit(f'br label %"{operands[0]}"' if parts[0] == "bra" else "ret void")
        else:
            try:
                getattr(self, f"do_{parts[0]}")(parts, operands)
            except (AttributeError, NotImplementedError):
                self.unknown(line)
            if label:
                self.emit(f"br label %{label}")
        if label:
            self.code.append(f"{label}:")
        return not label and parts[0] in ("bra", "ret", "exit")

    def do_mov(self, parts: list[str], operands: list[str]) -> None:
        """Copy bits; those of several registers side by side, the first lowest, are written in braces."""
        to, source = operands
        width = WIDTHS[parts[-1]]
        pieces = (to if to[0] == "{" else source).strip("{}").replace(" ", "").split(",")
        piece = width // len(pieces)
        if to[0] == "{":
            whole = self.get(source, width)
            for k, register in enumerate(pieces):
                shifted = self.new(f"lshr i{width} {whole}, {k * piece}")
                if register != "_":  # not wanted
                    self.put(register, self.new(f"trunc i{width} {shifted} to i{piece}"), piece)
        elif source[0] == "{":
            whole = "0"
            for k, register in enumerate(pieces):
                wide = self.new(f"zext i{piece} {self.get(register, piece)} to i{width}")
                whole = self.new(f"or i{width} {whole}, {self.new(f'shl i{width} {wide}, {k * piece}')}")
            self.put(to, whole, width)
        else:
            self.put(to, self.get(source, width), width)

    def do_cvta(self, parts: list[str], operands: list[str]) -> None:
        self.put(operands[0], self.get(operands[1], 64), 64)  # all memory has one kind of address here

    def do_ld(self, parts: list[str], operands: list[str]) -> None:
        kind, space = parts[-1], parts[1:-1]
        if space == ["param"]:
            match = re.fullmatch(rf"\[{re.escape(self.name)}_param_(\d+)\]", operands[1])
            if match is None or WIDTHS[kind] != 64:
                raise NotImplementedError
            place = self.new(f"getelementptr i64, ptr %words, i64 {match[1]}")
            self.put(operands[0], self.new(f"load i64, ptr {place}"), 64)
            return
        vector = self.vector(space)
        pointer, width = self.address(operands[1]), WIDTHS[kind]
        registers = operands[0].strip("{}").replace(" ", "").split(",")
        for k, register in enumerate(registers):
            place = self.new(f"getelementptr i{width}, ptr {pointer}, i64 {k}")
            self.put(register, self.new(f"load i{width}, ptr {place}, align 1"), width, kind[0] == "s")
        if len(registers) != vector:
            raise NotImplementedError

    def do_st(self, parts: list[str], operands: list[str]) -> None:
        kind, vector = parts[-1], self.vector(parts[1:-1])
        pointer, width = self.address(operands[0]), WIDTHS[kind]
        values = operands[1].strip("{}").replace(" ", "").split(",")
        for k, value in enumerate(values):
            place = self.new(f"getelementptr i{width}, ptr {pointer}, i64 {k}")
            self.emit(f"store i{width} {self.get(value, width)}, ptr {place}, align 1")
        if len(values) != vector:
            raise NotImplementedError

    def vector(self, space: list[str]) -> int:
        """How many values an access to memory takes."""
        if not set(space) <= {"global", "local", "nc", "v2", "v4"}:
            raise NotImplementedError
        return next((int(one[1]) for one in space if one[0] == "v"), 1)

    def do_selp(self, parts: list[str], operands: list[str]) -> None:
        to, yes, no, test = operands
        width = WIDTHS[parts[-1]]
        a, b, p = self.get(yes, width), self.get(no, width), self.get(test, 1)
        self.put(to, self.new(f"select i1 {p}, i{width} {a}, i{width} {b}"), width)

    def do_setp(self, parts: list[str], operands: list[str]) -> None:
        if len(parts) != 3:
            raise NotImplementedError
        _, relation, kind = parts
        to, x, y = operands
        if kind in FLOATS:
            code = (ORDERED | UNORDERED)[relation]
            a, b = self.number_of(x, kind), self.number_of(y, kind)
            self.put(to, self.new(f"fcmp {code} {FLOATS[kind]} {a}, {b}"), 1)
            return
        names = {"lo": "ult", "ls": "ule", "hi": "ugt", "hs": "uge", "eq": "eq", "ne": "ne"}
        code = names.get(relation) or ("s" if kind[0] == "s" else "u") + relation
        width = WIDTHS[kind]
        self.put(to, self.new(f"icmp {code} i{width} {self.get(x, width)}, {self.get(y, width)}"), 1)

    def arithmetic(self, parts: list[str], operands: list[str]) -> None:
        """add, sub, and, or, xor, div, rem; mul of floating-point numbers."""
        name, kind = parts[0], parts[-1]
        to, x, y = operands
        if kind in FLOATS:
            if parts[1:-1] != ["rn"]:
                raise NotImplementedError
            a, b = self.number_of(x, kind), self.number_of(y, kind)
            self.put_number(to, self.new(f"{ARITHMETIC[name]} {FLOATS[kind]} {a}, {b}"), kind)
            return
        if len(parts) != 2:
            raise NotImplementedError
        width = WIDTHS[kind]
        code = name if name not in ("div", "rem") else f"s{name}" if kind[0] == "s" else f"u{name}"
        self.put(to, self.new(f"{code} i{width} {self.get(x, width)}, {self.get(y, width)}"), width)

    do_add = do_sub = do_and = do_or = do_xor = do_div = do_rem = arithmetic

    def do_mul(self, parts: list[str], operands: list[str]) -> None:
        if parts[-1] in FLOATS:
            return self.arithmetic(parts, operands)
        product, width = self.product(parts, *operands[1:])
        if parts[1] == "hi":
            high = self.new(f"lshr i{width} {product}, {width // 2}")
            product, width = self.new(f"trunc i{width} {high} to i{width // 2}"), width // 2
        self.put(operands[0], product, width)

    def do_mad(self, parts: list[str], operands: list[str]) -> None:
        if parts[-1] in FLOATS or parts[1] == "hi":
            raise NotImplementedError
        to, x, y, z = operands
        product, width = self.product(parts, x, y)
        self.put(to, self.new(f"add i{width} {product}, {self.get(z, width)}"), width)

    def product(self, parts: list[str], x: str, y: str) -> tuple[str, int]:
        """The product of whole numbers and its width, which is theirs or, of "wide" and "hi", twice as much."""
        kind, width = parts[-1], WIDTHS[parts[-1]]
        a, b = self.get(x, width), self.get(y, width)
        if parts[1] in ("wide", "hi"):
            extend = "sext" if kind[0] == "s" else "zext"
            a, b = (self.new(f"{extend} i{width} {one} to i{2 * width}") for one in (a, b))
            width *= 2
        elif parts[1] != "lo":
            raise NotImplementedError
        return self.new(f"mul i{width} {a}, {b}"), width

    def root_or_inverse(self, parts: list[str], operands: list[str]) -> None:
        """sqrt, rcp."""
        name, kind = parts[0], parts[-1]
        if parts[1:-1] != ["rn"]:
            raise NotImplementedError
        own, value = FLOATS[kind], self.number_of(operands[1], kind)
        code = f"call {own} @llvm.sqrt.{kind}({own} {value})" if name == "sqrt" else f"fdiv {own} 1.0, {value}"
        self.put_number(operands[0], self.new(code), kind)

    do_sqrt = do_rcp = root_or_inverse

    def do_abs(self, parts: list[str], operands: list[str]) -> None:
        kind, width = parts[-1], WIDTHS[parts[-1]]
        value = self.get(operands[1], width)
        if kind in FLOATS:
            self.put(operands[0], self.new(f"and i{width} {value}, {2 ** (width - 1) - 1}"), width)
        else:
            self.put(operands[0], self.new(f"call i{width} @llvm.abs.i{width}(i{width} {value}, i1 false)"), width)

    def do_neg(self, parts: list[str], operands: list[str]) -> None:
        kind, width = parts[-1], WIDTHS[parts[-1]]
        value = self.get(operands[1], width)
        code = f"xor i{width} {value}, {2 ** (width - 1)}" if kind in FLOATS else f"sub i{width} 0, {value}"
        self.put(operands[0], self.new(code), width)

    def do_copysign(self, parts: list[str], operands: list[str]) -> None:
        width = WIDTHS[parts[-1]]
        sign = self.new(f"and i{width} {self.get(operands[1], width)}, {2 ** (width - 1)}")
        rest = self.new(f"and i{width} {self.get(operands[2], width)}, {2 ** (width - 1) - 1}")
        self.put(operands[0], self.new(f"or i{width} {sign}, {rest}"), width)

    def do_not(self, parts: list[str], operands: list[str]) -> None:
        width = WIDTHS[parts[-1]]
        self.put(operands[0], self.new(f"xor i{width} {self.get(operands[1], width)}, -1"), width)

    def smaller_or_larger(self, parts: list[str], operands: list[str]) -> None:
        """min, max: of floating-point numbers the one that is no nan, and -0 below 0."""
        name, kind = parts[0], parts[-1]
        to, x, y = operands
        if len(parts) != 2:
            raise NotImplementedError
        if kind not in FLOATS:
            width, code = WIDTHS[kind], ("s" if kind[0] == "s" else "u") + name
            a, b = self.get(x, width), self.get(y, width)
            self.put(to, self.new(f"call i{width} @llvm.{code}.i{width}(i{width} {a}, i{width} {b})"), width)
            return
        own, width = FLOATS[kind], WIDTHS[kind]
        a, b = self.number_of(x, kind), self.number_of(y, kind)
        first = self.new(f"fcmp {'olt' if name == 'min' else 'ogt'} {own} {a}, {b}")
        best = self.new(f"select i1 {first}, {own} {a}, {own} {b}")
        # Equal numbers differ in the sign of zero alone: or of the bits is -0 if one is, and of the bits 0 if one is.
        bits = [self.new(f"bitcast {own} {one} to i{width}") for one in (a, b)]
        zero = self.new(f"{'or' if name == 'min' else 'and'} i{width} {bits[0]}, {bits[1]}")
        same, zero = self.new(f"fcmp oeq {own} {a}, {b}"), self.new(f"bitcast i{width} {zero} to {own}")
        best = self.new(f"select i1 {same}, {own} {zero}, {own} {best}")
        for nan, other in ((a, b), (b, a)):
            is_nan = self.new(f"fcmp uno {own} {nan}, {nan}")
            best = self.new(f"select i1 {is_nan}, {own} {other}, {own} {best}")
        self.put_number(to, best, kind)

    do_min = do_max = smaller_or_larger

    def shift(self, parts: list[str], operands: list[str]) -> None:
        """shl, shr: by the width of the number or more gives 0, or the sign."""
        kind, width = parts[-1], WIDTHS[parts[-1]]
        to, x, y = operands
        value, by = self.get(x, width), self.get(y, 32)
        signed = kind[0] == "s"
        code = "shl" if parts[0] == "shl" else "ashr" if signed else "lshr"
        most = self.new(f"call i32 @llvm.umin.i32(i32 {by}, i32 {width - 1})")
        wide = most if width == 32 else self.new(f"{'zext' if width > 32 else 'trunc'} i32 {most} to i{width}")
        shifted = self.new(f"{code} i{width} {value}, {wide}")
        if code != "ashr":
            over = self.new(f"icmp ugt i32 {by}, {width - 1}")
            shifted = self.new(f"select i1 {over}, i{width} 0, i{width} {shifted}")
        self.put(to, shifted, width)

    do_shl = do_shr = shift

    def do_shf(self, parts: list[str], operands: list[str]) -> None:
        if parts[2:] != ["wrap", "b32"]:
            raise NotImplementedError
        to, low, high, by = (operands[0], *(self.get(one, 32) for one in operands[1:]))
        code = "fshl" if parts[1] == "l" else "fshr"
        self.put(to, self.new(f"call i32 @llvm.{code}.i32(i32 {high}, i32 {low}, i32 {by})"), 32)

    def do_prmt(self, parts: list[str], operands: list[str]) -> None:
        """Four bytes out of eight, or of the signs of bytes."""
        to, x, y, selector = operands
        if parts != ["prmt", "b32"] or not re.fullmatch(r"0x[0-9A-Fa-f]+U?|\d+", selector):
            raise NotImplementedError
        chosen = int(selector.rstrip("U"), 0)
        low, high = self.new(f"zext i32 {self.get(x, 32)} to i64"), self.new(f"zext i32 {self.get(y, 32)} to i64")
        both = self.new(f"or i64 {low}, {self.new(f'shl i64 {high}, 32')}")
        result = "0"
        for k in range(4):
            nibble = chosen >> 4 * k & 15
            byte = self.new(f"trunc i64 {self.new(f'lshr i64 {both}, {8 * (nibble & 7)}')} to i8")
            if nibble & 8:
                byte = self.new(f"ashr i8 {byte}, 7")
            placed = self.new(f"shl i32 {self.new(f'zext i8 {byte} to i32')}, {8 * k}")
            result = self.new(f"or i32 {result}, {placed}")
        self.put(to, result, 32)

    def do_bfe(self, parts: list[str], operands: list[str]) -> None:
        kind = parts[-1]
        to, x, position, length = operands
        if kind[0] != "u" or not (position.isdigit() and length.isdigit()):
            raise NotImplementedError
        width = WIDTHS[kind]
        shifted = self.new(f"lshr i{width} {self.get(x, width)}, {position}")
        self.put(to, self.new(f"and i{width} {shifted}, {2 ** int(length) - 1}"), width)

    def counted(self, parts: list[str], operands: list[str]) -> None:
        """clz, popc, whose results have 32 bits; brev."""
        width, name = WIDTHS[parts[-1]], {"clz": "ctlz", "popc": "ctpop", "brev": "bitreverse"}[parts[0]]
        flag = ", i1 false" if name == "ctlz" else ""
        value = self.new(f"call i{width} @llvm.{name}.i{width}(i{width} {self.get(operands[1], width)}{flag})")
        if name != "bitreverse" and width == 64:
            value = self.new(f"trunc i64 {value} to i32")
        self.put(operands[0], value, width if name == "bitreverse" else 32)

    do_clz = do_popc = do_brev = counted

    def do_cvt(self, parts: list[str], operands: list[str]) -> None:
        rounding, to_kind, from_kind = parts[1:-2], parts[-2], parts[-1]
        to, source = operands
        width, own = WIDTHS[to_kind], WIDTHS[from_kind]
        if to_kind in FLOATS and from_kind in FLOATS:
            value = self.number_of(source, from_kind)
            if to_kind == from_kind and rounding and rounding[0] in ROUNDED:
                name = FLOATS[to_kind]
                value = self.new(f"call {name} @llvm.{ROUNDED[rounding[0]]}.{to_kind}({name} {value})")
            elif (from_kind, to_kind, rounding) == ("f32", "f64", []):
                value = self.new(f"fpext float {value} to double")
            elif (from_kind, to_kind, rounding) == ("f64", "f32", ["rn"]):
                value = self.new(f"fptrunc double {value} to float")
            else:
                raise NotImplementedError
            self.put_number(to, value, to_kind)
        elif to_kind in FLOATS:
            if rounding != ["rn"]:
                raise NotImplementedError
            code = "sitofp" if from_kind[0] == "s" else "uitofp"
            value = self.new(f"{code} i{own} {self.get(source, own)} to {FLOATS[to_kind]}")
            self.put_number(to, value, to_kind)
        elif from_kind in FLOATS:
            if rounding != ["rzi"]:
                raise NotImplementedError
            self.put(to, self.whole(self.number_of(source, from_kind), from_kind, to_kind), width, to_kind[0] == "s")
        else:
            if rounding:
                raise NotImplementedError
            value = self.get(source, own)
            if width > own:
                value = self.new(f"{'sext' if from_kind[0] == 's' else 'zext'} i{own} {value} to i{width}")
            elif width < own:
                value = self.new(f"trunc i{own} {value} to i{width}")
            self.put(to, value, width, to_kind[0] == "s")

    def whole(self, value: str, from_kind: str, to_kind: str) -> str:
        """A number without its fraction: beyond the range its end, and for nan what the manual says."""
        signed, width, name = to_kind[0] == "s", WIDTHS[to_kind], FLOATS[from_kind]
        code = f"llvm.fpto{'s' if signed else 'u'}i.sat.i{width}.{from_kind}"
        found = self.new(f"call i{width} @{code}({name} {value})")
        if width < 64 and from_kind == "f32":
            return found  # 0 for nan
        is_nan = self.new(f"fcmp uno {name} {value}, {value}")
        return self.new(f"select i1 {is_nan}, i{width} {2 ** (width - 1)}, i{width} {found}")


LOOP = """define void @"run NAME"(i64 %blocks, i64 %threads, ptr %words, i64 %own) {
  %ntid = trunc i64 %threads to i32
  %nctaid = trunc i64 %blocks to i32
  %all = mul i64 %blocks, %threads
  br label %head
head:
  %k = phi i64 [ 0, %0 ], [ %next, %body ]
  %more = icmp ult i64 %k, %all
  br i1 %more, label %body, label %done
body:
  %a = urem i64 %k, %threads
  %b = udiv i64 %k, %threads
  %tid = trunc i64 %a to i32
  %ctaid = trunc i64 %b to i32
  call void @"thread NAME"(i32 %tid, i32 %ntid, i32 %ctaid, i32 %nctaid, ptr %words, i64 %own)
  %next = add i64 %k, 1
  br label %head
done:
  ret void
}"""


def declaration(name: str) -> str:
    """IR that declares one of LLVM's functions."""
    parts = name.split(".")
    kinds = {"f32": "float", "f64": "double"}
    kind = kinds.get(parts[-1], parts[-1])
    if name == "llvm.trap":
        return "declare void @llvm.trap()"
    if "memset" in name:
        return f"declare void @{name}(ptr, i8, i64, i1)"
    if ".sat." in name:
        return f"declare {parts[-2]} @{name}({kind})"
    more = {"abs": ", i1", "ctlz": ", i1", "fshl": f", {kind}, {kind}", "fshr": f", {kind}, {kind}"}.get(parts[1], "")
    two = f", {kind}" if parts[1] in ("smin", "smax", "umin", "umax") else ""
    return f"declare {kind} @{name}({kind}{more}{two})"
