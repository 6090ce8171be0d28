"""The compiled forward pass of a network: rows of a table of whole numbers, computed one after the other.

What follows holds for every function here, and makes the results equal to the bit on all processors. Products and
sums of layers are of float32, and each output's sum runs over its inputs in one order: the bias first, then rows,
columns and channels as they come. Only outputs that do not depend on each other are computed side by side, so the number
of lanes that a processor has changes nothing, nor does the number of environments. The order of other sums stands in
their loops. Nothing is contracted or reordered, and elementary functions are those of
:mod:`segar.support.mathematics`.

All activations of an environment lie in one row of ``scratch``, at offsets that the table holds, as ``[image, height,
width, channel]``. The functions take arrays and whole numbers, allocate nothing, and need no interpreter.
"""

import math

import numpy as np

from segar.support import cached, keyed_uniform, mathematics

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}

# Columns of the table: which operation it is, where in a row of the scratch its inputs and its outputs begin, their
# sizes, and where its weights begin in ``floats``, and the places of its windows in ``places``.
(
    OPERATION, SOURCE, OTHER, TARGET, IMAGES, HEIGHT, WIDTH, CHANNELS, OUT_HEIGHT, OUT_WIDTH, OUT_CHANNELS, KERNEL,
    STRIDE, PADDING, FLOATS, PLACES,
) = range(16)  # fmt: skip

(
    OBSERVE, RECALL, PAD, SUM_PRODUCTS, MAX_POOL, RELU, TANH, ADD, FLATTEN, LAYER_NORM, SOFT_ARGMAX, MOVEMENTS, GRU,
    LSTM,
) = range(14)  # fmt: skip

TILE = 16  # outputs whose sums are computed side by side
ROWS = 4  # windows whose sums are computed at once, with the same weights
SITE = 0x5E6A  # of the draws of actions, far from those of rules, which count from 0
TINY = 1e-30  # keeps a soft-argmax finite where no cell responds


@cached(**_options)
def forward(table, places, floats, observations, memory, scratch, width, sums, first, count):
    """Fill ``scratch`` with the activations of ``count`` environments from ``first`` on, and step their memory.

    Args:
        table, places, floats: those of a :class:`segar.policies.forward_pass.ForwardPass`.
        observations: uint8 or float32 ``[environment, number]``.
        memory: float32 ``[environment, number]``.
        scratch: float32, at least ``count`` rows of ``width`` numbers, one after the other.
        sums: float32 ``[ROWS * TILE]``, scratch, too.
    """
    for i in range(len(table)):
        row = table[i]
        operation = row[OPERATION]
        if operation == SUM_PRODUCTS:
            sum_products(row, places, floats, scratch, width, sums, count)
            continue
        for e in range(count):
            x = scratch[e * width : (e + 1) * width]
            if operation == OBSERVE:
                observe(row, floats, observations[first + e], x)
            elif operation == RECALL:
                recall(row, memory[first + e], x)
            elif operation == PAD:
                pad(row, x)
            elif operation == MAX_POOL:
                max_pool(row, x)
            elif operation == RELU:
                relu(row, x)
            elif operation == TANH:
                squash(row, x)
            elif operation == ADD:
                add(row, x)
            elif operation == FLATTEN:
                flatten(row, x)
            elif operation == LAYER_NORM:
                layer_norm(row, floats, x)
            elif operation == SOFT_ARGMAX:
                soft_argmax(row, floats, x)
            elif operation == MOVEMENTS:
                movements(row, floats, x)
            elif operation == GRU:
                gru(row, memory[first + e], x)
            elif operation == LSTM:
                lstm(row, memory[first + e], x)


@cached(**_options)
def act(
    scratch, width, mean, log_std, lowest, highest, center, half_range, keys, steps, sampled, actions, first, count
):
    """Write the actions of ``count`` environments from ``first`` on, float32 ``[environment, component]``.

    The policy is the distribution of tanh(u), with u normal of this mean and of standard deviation exp(log_std);
    log_std is held between ``lowest`` and ``highest``. The action without noise is tanh(mean). The noise of a component
    depends on the episode's key (uint64), the step (int64) and the component alone.

    Args:
        mean, log_std: offsets in a row of ``scratch``.
        center, half_range: float32 ``[component]``, of the actions' range.
    """
    for e in range(count):
        for a in range(actions.shape[1]):
            u = scratch[e * width + mean + a]
            if sampled:
                bounded = min(max(np.float64(scratch[e * width + log_std + a]), lowest), highest)
                key, step = keys[first + e], steps[first + e]
                u = np.float32(u + np.float32(mathematics.exp(bounded)) * np.float32(normal(key, step, a)))
            action = np.float32(mathematics.tanh(np.float64(u)))
            actions[first + e, a] = center[a] + half_range[a] * action
        steps[first + e] += 1


@cached(**_options)
def decide(
    rows, table, places, floats, observations, memory, scratch, width, sums, mean, log_std, lowest, highest, center, half_range,
    keys, steps, sampled, actions, value, values,
):  # fmt: skip
    """:func:`forward` and :func:`act` for the environments ``rows``, each in its own row of ``scratch``.

    Where ``value`` is not negative, it is an offset in such a row, of a number that is written into ``values``.
    """
    for env in rows:
        forward(table, places, floats, observations, memory, scratch[env], width, sums, env, 1)
        act(
            scratch[env], width, mean, log_std, lowest, highest, center, half_range, keys, steps, sampled, actions, env, 1
        )  # fmt: skip
        if value >= 0:
            values[env] = scratch[env, value]


@cached(**_options)
def normal(key, step, component):
    """A number from N(0, 1), by the transform of Box and Muller of two uniform ones."""
    radius = math.sqrt(-2.0 * mathematics.log(1.0 - keyed_uniform(key, step, SITE, component, 0, 0)))
    return radius * mathematics.cos(2.0 * math.pi * keyed_uniform(key, step, SITE, component, 1, 0))


@cached(**_options)
def sum_products(row, places, floats, scratch, width, sums, count):
    """A dense layer, or a convolution: the bias, plus the products of weights and of what a window of the input holds.

    A window is ``KERNEL`` pieces, each of ``KERNEL * CHANNELS`` numbers that lie side by side. Weights are stored in
    tiles of ``TILE`` outputs: their biases, and then by input and output.
    """
    source, target, outputs = row[SOURCE], row[TARGET], row[OUT_CHANNELS]
    windows = row[IMAGES] * row[OUT_HEIGHT] * row[OUT_WIDTH]
    pieces, length, apart = row[KERNEL], row[KERNEL] * row[CHANNELS], row[WIDTH] * row[CHANNELS]
    first_place, tile_size = row[PLACES], TILE * (1 + pieces * length)
    for tile in range((outputs + TILE - 1) // TILE):
        weights = row[FLOATS] + tile * tile_size
        bias = floats[weights : weights + TILE]
        kept = min(TILE, outputs - tile * TILE)
        for window in range(0, count * windows, ROWS):
            last = count * windows - 1
            # Where fewer than four windows are left, the last one is computed again.
            e0, p0 = divided(window, windows)
            e1, p1 = divided(min(window + 1, last), windows)
            e2, p2 = divided(min(window + 2, last), windows)
            e3, p3 = divided(min(window + 3, last), windows)
            i0 = e0 * width + source + places[first_place + p0]
            i1 = e1 * width + source + places[first_place + p1]
            i2 = e2 * width + source + places[first_place + p2]
            i3 = e3 * width + source + places[first_place + p3]
            for c in range(TILE):
                sums[c] = sums[TILE + c] = sums[2 * TILE + c] = sums[3 * TILE + c] = bias[c]
            for piece in range(pieces):
                at, skip = weights + TILE * (1 + piece * length), piece * apart
                add_products(scratch, i0 + skip, i1 + skip, i2 + skip, i3 + skip, length, floats, at, sums)
            to = target + tile * TILE
            copy(sums, 0, scratch, e0 * width + to + p0 * outputs, kept)
            copy(sums, TILE, scratch, e1 * width + to + p1 * outputs, kept)
            copy(sums, 2 * TILE, scratch, e2 * width + to + p2 * outputs, kept)
            copy(sums, 3 * TILE, scratch, e3 * width + to + p3 * outputs, kept)


@cached(**_options)
def divided(number, by):
    """Quotient and rest of whole numbers that are not negative."""
    quotient = np.int64(np.uint64(number) // np.uint64(by))
    return quotient, number - quotient * by


@cached(**_options)
def copy(x, source, y, to, count):
    """Copy ``count`` numbers of ``x`` from ``source`` on into ``y`` from ``to`` on."""
    given, gives = x[source : source + count], y[to : to + count]
    for c in range(count):
        gives[c] = given[c]


@cached(**_options)
def add_products(x, i0, i1, i2, i3, length, floats, at, sums):
    """Add to the sums of four windows the products of ``length`` numbers from their places in ``x`` on, in their order.

    Four products are added at once to a sum that is read and written once, in the same order as one by one.
    """
    k = 0
    while k + 4 <= length:
        a0, a1, a2, a3 = x[i0 + k], x[i1 + k], x[i2 + k], x[i3 + k]
        b0, b1, b2, b3 = x[i0 + k + 1], x[i1 + k + 1], x[i2 + k + 1], x[i3 + k + 1]
        c0, c1, c2, c3 = x[i0 + k + 2], x[i1 + k + 2], x[i2 + k + 2], x[i3 + k + 2]
        d0, d1, d2, d3 = x[i0 + k + 3], x[i1 + k + 3], x[i2 + k + 3], x[i3 + k + 3]
        w = floats[at + k * TILE : at + (k + 4) * TILE]
        for c in range(TILE):
            a, b, g, d = w[c], w[TILE + c], w[2 * TILE + c], w[3 * TILE + c]
            sums[c] = (((sums[c] + a0 * a) + b0 * b) + c0 * g) + d0 * d
            sums[TILE + c] = (((sums[TILE + c] + a1 * a) + b1 * b) + c1 * g) + d1 * d
            sums[2 * TILE + c] = (((sums[2 * TILE + c] + a2 * a) + b2 * b) + c2 * g) + d2 * d
            sums[3 * TILE + c] = (((sums[3 * TILE + c] + a3 * a) + b3 * b) + c3 * g) + d3 * d
        k += 4
    while k < length:
        a0, a1, a2, a3 = x[i0 + k], x[i1 + k], x[i2 + k], x[i3 + k]
        w = floats[at + k * TILE : at + (k + 1) * TILE]
        for c in range(TILE):
            sums[c] = sums[c] + a0 * w[c]
            sums[TILE + c] = sums[TILE + c] + a1 * w[c]
            sums[2 * TILE + c] = sums[2 * TILE + c] + a2 * w[c]
            sums[3 * TILE + c] = sums[3 * TILE + c] + a3 * w[c]
        k += 1


@cached(**_options)
def observe(row, floats, observation, x):
    """An observation ``[height, width, image, channel]``, times a scale, as ``[image, height, width, channel]``."""
    images, pixels, channels = row[IMAGES], row[HEIGHT] * row[WIDTH], row[CHANNELS]
    scale, gives = floats[row[FLOATS]], x[row[TARGET] : row[TARGET] + size_of(row)]
    if images == 1:
        for c in range(pixels * channels):
            gives[c] = np.float32(observation[c]) * scale
        return
    for image in range(images):
        for pixel in range(pixels):
            to, source = (image * pixels + pixel) * channels, (pixel * images + image) * channels
            for c in range(channels):
                gives[to + c] = np.float32(observation[source + c]) * scale


@cached(**_options)
def recall(row, memory, x):
    """What is remembered of the last step."""
    copy(memory, 0, x, row[TARGET], row[CHANNELS])


@cached(**_options)
def pad(row, x):
    """Images with a border of zeros."""
    height, width, padding, channels = row[HEIGHT], row[WIDTH], row[PADDING], row[CHANNELS]
    out_height, out_width = row[OUT_HEIGHT], row[OUT_WIDTH]
    x[row[TARGET] : row[TARGET] + row[IMAGES] * out_height * out_width * channels] = np.float32(0.0)
    for image in range(row[IMAGES]):
        for y in range(height):
            source = row[SOURCE] + (image * height + y) * width * channels
            to = row[TARGET] + ((image * out_height + y + padding) * out_width + padding) * channels
            copy(x, source, x, to, width * channels)


@cached(**_options)
def max_pool(row, x):
    """The largest number of each channel in each window; windows may reach beyond the image, where nothing is."""
    height, width, channels = row[HEIGHT], row[WIDTH], row[CHANNELS]
    out_height, out_width, kernel = row[OUT_HEIGHT], row[OUT_WIDTH], row[KERNEL]
    for window in range(row[IMAGES] * out_height * out_width):
        place, left = divided(window, out_width)
        image, top = divided(place, out_height)
        highest = x[row[TARGET] + window * channels : row[TARGET] + (window + 1) * channels]
        top, left = top * row[STRIDE] - row[PADDING], left * row[STRIDE] - row[PADDING]
        highest[:] = np.float32(-np.inf)
        for y in range(max(top, 0), min(top + kernel, height)):
            for z in range(max(left, 0), min(left + kernel, width)):
                source = row[SOURCE] + ((image * height + y) * width + z) * channels
                given = x[source : source + channels]
                for c in range(channels):
                    highest[c] = max(highest[c], given[c])


@cached(**_options)
def relu(row, x):
    """Numbers above 0, and 0 in place of the others."""
    given, gives = x[row[SOURCE] : row[SOURCE] + size_of(row)], x[row[TARGET] : row[TARGET] + size_of(row)]
    for c in range(len(given)):
        gives[c] = max(given[c], np.float32(0.0))


@cached(**_options)
def squash(row, x):
    """The hyperbolic tangents."""
    for c in range(size_of(row)):
        x[row[TARGET] + c] = np.float32(mathematics.tanh(np.float64(x[row[SOURCE] + c])))


@cached(**_options)
def add(row, x):
    """The sums of two inputs."""
    one, other = x[row[SOURCE] : row[SOURCE] + size_of(row)], x[row[OTHER] : row[OTHER] + size_of(row)]
    gives = x[row[TARGET] : row[TARGET] + size_of(row)]
    for c in range(len(one)):
        gives[c] = one[c] + other[c]


@cached(**_options)
def size_of(row):
    """How many numbers an operation reads."""
    return row[IMAGES] * row[HEIGHT] * row[WIDTH] * row[CHANNELS]


@cached(**_options)
def flatten(row, x):
    """An image as a vector ``[channel, height, width]``."""
    pixels, channels = row[HEIGHT] * row[WIDTH], row[CHANNELS]
    for pixel in range(pixels):
        for c in range(channels):
            x[row[TARGET] + c * pixels + pixel] = x[row[SOURCE] + pixel * channels + c]


@cached(**_options)
def layer_norm(row, floats, x):
    """A vector less its mean, divided by its standard deviation, times weights, plus biases; in float64."""
    count, source, weights = row[CHANNELS], row[SOURCE], row[FLOATS] + 1
    mean = 0.0
    for c in range(count):
        mean += np.float64(x[source + c])
    mean = mean / count
    variance = 0.0
    for c in range(count):
        variance += (np.float64(x[source + c]) - mean) * (np.float64(x[source + c]) - mean)
    deviation = math.sqrt(variance / count + np.float64(floats[row[FLOATS]]))
    for c in range(count):
        centerd = (np.float64(x[source + c]) - mean) / deviation
        weighted = centerd * np.float64(floats[weights + c]) + np.float64(floats[weights + count + c])
        x[row[TARGET] + c] = np.float32(weighted)


@cached(**_options)
def soft_argmax(row, floats, x):
    """The mean place of each channel of each image, ``[image, (x, y), channel]``, in float64.

    Cells count by the exponential of what they hold, less the largest number of the whole image.
    """
    cells, channels = row[HEIGHT] * row[WIDTH], row[CHANNELS]
    for image in range(row[IMAGES]):
        source, to = row[SOURCE] + image * cells * channels, row[TARGET] + image * 2 * channels
        highest = x[source]
        for c in range(cells * channels):
            highest = max(highest, x[source + c])
        for c in range(channels):
            total, across, down = 0.0, 0.0, 0.0
            for cell in range(cells):
                weight = mathematics.exp(np.float64(x[source + cell * channels + c]) - np.float64(highest))
                total += weight
                across += weight * np.float64(floats[row[FLOATS] + 2 * cell])
                down += weight * np.float64(floats[row[FLOATS] + 2 * cell + 1])
            x[to + c] = np.float32(across / (total + TINY))
            x[to + channels + c] = np.float32(down / (total + TINY))


@cached(**_options)
def movements(row, floats, x):
    """The last image's numbers, and then by how much those of each image differ from the one before, times a factor."""
    size, images, source, to = size_of(row) // row[IMAGES], row[IMAGES], row[SOURCE], row[TARGET]
    factor = floats[row[FLOATS]]
    for c in range(size):
        x[to + c] = x[source + (images - 1) * size + c]
    for c in range((images - 1) * size):
        x[to + size + c] = (x[source + size + c] - x[source + c]) * factor


@cached(**_options)
def gru(row, memory, x):
    """The next hidden numbers of a GRU, from the sums of its gates over the input and over the memory."""
    width, given, known = row[CHANNELS], row[SOURCE], row[OTHER]
    for c in range(width):
        reset = sigmoid(x[given + c] + x[known + c])
        update = sigmoid(x[given + width + c] + x[known + width + c])
        fresh = x[given + 2 * width + c] + reset * x[known + 2 * width + c]
        fresh = np.float32(mathematics.tanh(np.float64(fresh)))
        memory[c] = (np.float32(1.0) - update) * fresh + update * memory[c]
        x[row[TARGET] + c] = memory[c]


@cached(**_options)
def lstm(row, memory, x):
    """The next hidden numbers of an LSTM, likewise; after them in ``memory`` lie its cells."""
    width, given, known = row[CHANNELS], row[SOURCE], row[OTHER]
    for c in range(width):
        enter = sigmoid(x[given + c] + x[known + c])
        stay = sigmoid(x[given + width + c] + x[known + width + c])
        fresh = np.float32(mathematics.tanh(np.float64(x[given + 2 * width + c] + x[known + 2 * width + c])))
        leave = sigmoid(x[given + 3 * width + c] + x[known + 3 * width + c])
        memory[width + c] = stay * memory[width + c] + enter * fresh
        memory[c] = leave * np.float32(mathematics.tanh(np.float64(memory[width + c])))
        x[row[TARGET] + c] = memory[c]


@cached(**_options)
def sigmoid(x):
    """The logistic function, float32."""
    return np.float32(1.0 / (1.0 + mathematics.exp(-np.float64(x))))
