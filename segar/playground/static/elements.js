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

/** What may be longer than its place: a part that scrolls, with a name for who does not see it. */
export function scroll(label, ...children) {
  return make("div", { className: "scroll", tabIndex: 0, role: "region", "aria-label": label }, ...children);
}

/** A table; the caption may be null. Its rows are as tableRow takes them, and those of tBodies[0] can be replaced. */
export function table(caption, head, rows = []) {
  const above = caption === null ? [] : [make("caption", { className: "note", textContent: caption })];
  const names = head.map((textContent) => make("th", { textContent, scope: "col" }));
  return make("table", {}, ...above, make("thead", {}, make("tr", {}, ...names)), make("tbody", {}, ...rows.map(tableRow)));
}

/** A row of a table: of elements, texts, and numbers, which are shortened. */
export function tableRow(cells) {
  return make("tr", {}, ...cells.map((one) => make("td", {}, typeof one === "number" ? short(one) : one)));
}

/** An element of a drawing. */
export function drawn(tag, about) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(about)) element.setAttribute(name, value);
  return element;
}

/** Make the buttons in an element one stop of the Tab key; arrow keys, Home and End go from one to the next. */
export function oneStop(group) {
  group.addEventListener("focusin", ({ target }) => {
    for (const one of group.children) one.tabIndex = one === target ? 0 : -1;
  });
  group.addEventListener("keydown", (event) => {
    const buttons = [...group.children];
    const across = buttons.filter((one) => one.offsetTop === buttons[0].offsetTop).length;
    const last = buttons.length - 1;
    const moves = { ArrowRight: 1, ArrowLeft: -1, ArrowDown: across, ArrowUp: -across, Home: -last, End: last };
    if (!(event.key in moves)) return;
    event.preventDefault();
    event.stopPropagation();
    buttons[Math.min(Math.max(buttons.indexOf(event.target) + moves[event.key], 0), last)].focus();
  });
  return group;
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
