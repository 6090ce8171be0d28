/** Addresses that open a page at a level: which levels, which of them, the seed, and what was changed stand in the fragment. */

import { asText, levelData, readLevel } from "segar/level_text.js";

const LONGEST = 50_000; // characters of the text of a changed level in an address, packed

/** The fragment that opens a page at the level that it shows. */
export async function fragmentOf(page) {
  const { levels, level } = page;
  const parts = { levels: levels.about.hash, level };
  if (page.seed) parts.seed = page.seed;
  if (levels.changed.has(level)) parts.is = await packed(asText(levelData(levels, level)));
  return `#${new URLSearchParams(parts)}`;
}

/** Show what a fragment says; a RangeError says why it cannot be shown. One without `levels` means those that are shown. */
export async function follow(page, fragment) {
  const parts = new URLSearchParams(fragment.slice(1));
  if (!["levels", "level", "seed"].some((name) => parts.has(name))) return;
  const set = parts.has("levels") ? page.sets.findIndex((one) => one.about.hash === parts.get("levels")) : page.set;
  if (set < 0) throw new RangeError("it was made in a page of other levels");
  const levels = page.sets[set];
  const level = whole(parts.get("level") ?? String(page.level), BigInt(levels.count), "level");
  const seed = whole(parts.get("seed") ?? "0", 1n << 64n, "seed");
  const text = parts.has("is") ? await unpacked(parts.get("is")) : null;
  if (text !== null) readLevel(levels, Number(level), text);
  page.show(set, Number(level), seed);
}

function whole(text, limit, name) {
  if (!/^\d{1,20}$/.test(text) || BigInt(text) >= limit) throw new RangeError(`its ${name} must be a whole number below ${limit}, not ${text}`);
  return BigInt(text);
}

/** Text as few characters that may stand in an address. */
async function packed(text) {
  const stream = new Blob([text]).stream().pipeThrough(new CompressionStream("deflate-raw"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  return btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

async function unpacked(text) {
  if (text.length > LONGEST) throw new RangeError(`its level has ${text.length} characters, and at most ${LONGEST} are read`);
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (one) => one.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return await new Response(stream).text();
  } catch (error) {
    throw new RangeError("the level in it is damaged; take the link again, whole", { cause: error });
  }
}
