// The token that lets this page in: from the address's fragment, then kept for this tab only.

import { make } from "viewer/dom.js";

const KEPT_AS = "viewer-token";

/** The token, or null. It is removed from the address, so that nobody copies it with the address. */
export function findToken() {
  const hash = location.hash.slice(1);
  const given = new URLSearchParams(hash).get("token") ?? (hash.includes("=") ? null : decodeURIComponent(hash));
  if (given) {
    keepToken(given);
    history.replaceState(null, "", location.pathname + location.search);
    return given;
  }
  try {
    return sessionStorage.getItem(KEPT_AS);
  } catch {
    return null;
  }
}

export function keepToken(token) {
  try {
    sessionStorage.setItem(KEPT_AS, token);
  } catch {
    // Without storage the token is asked again after a reload.
  }
}

/** Asks for the token; `given(token)` hears it. */
export function askToken(root, text, given) {
  root.querySelector(".token-form")?.remove();
  const field = make("input", {
    type: "password",
    id: "token",
    autocomplete: "off",
    autocapitalize: "off",
    spellcheck: "false",
    required: true,
  });
  const form = make(
    "form",
    { class: "token-form", "aria-label": "Token" },
    make("h2", {}, "A token is needed"),
    make("p", {}, text),
    make("label", { for: "token" }, "Token"),
    field,
    make("button", { type: "submit", class: "strong" }, "Connect"),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const token = field.value.trim();
    if (!token) return;
    keepToken(token);
    form.remove();
    given(token);
  });
  root.append(form);
  field.focus();
}
