// Makes and changes elements. Texts from outside only ever become text nodes, never HTML.

/** Makes an element: `make("button", {class: "x", onclick: f, "aria-label": "y"}, child, "text")`. */
export function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

/** Sets the text of an element, only when it differs: untouched elements cost no layout and are not read out again. */
export function setText(node, text) {
  const wanted = String(text);
  if (node.textContent !== wanted) node.textContent = wanted;
}

/** Sets or removes an attribute, only when it differs. */
export function setAttribute(node, name, value) {
  if (value === null || value === undefined) {
    if (node.hasAttribute(name)) node.removeAttribute(name);
  } else if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value);
}

/** Whether a key press belongs to what has the focus (a text, a choice) and not to the page. */
export function typesInto(target) {
  return (
    target instanceof Element &&
    target.closest("input:not([type=range]):not([type=checkbox]), select, textarea") !== null
  );
}
