/** Elements of a page, made in one expression. */

/** An element with properties, attributes (names with a dash), listeners (names that begin with on) and children. */
export function make(tag, about = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(about)) {
    if (name.includes("-") || name === "role" || name === "for") element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

/** A panel that folds, with a title. */
export function panel(title, open, ...children) {
  return make("details", { open }, make("summary", {}, make("h2", { textContent: title })), ...children);
}

/** Give the person a file. */
export function download(name, text, type = "application/json") {
  const url = URL.createObjectURL(new Blob([text], { type }));
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** A number as people read it. */
export function short(x) {
  return Number.isFinite(x) ? String(Number(x.toPrecision(4))) : "–";
}
