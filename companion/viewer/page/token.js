// The token that lets this page in: from the address's fragment, then kept for this tab only.

import { make } from "viewer/dom.js";

const KEPT_AS = "viewer-token";

/** The token, or null. It is removed from the address, so that nobody copies it with the address. */
export function findToken() {
  const hash = location.hash.slice(1);
  const given = new URLSearchParams(hash).get("token") ?? (hash.includes("=") ? null : decoded(hash));
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

function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text; // a lone % sign
  }
}

function keepToken(token) {
  try {
    sessionStorage.setItem(KEPT_AS, token);
  } catch {
    // Without storage the token is asked again after a reload.
  }
}

/** A token that was refused is not sent again by a reload. */
export function forgetToken() {
  try {
    sessionStorage.removeItem(KEPT_AS);
  } catch {
    // Nothing was kept.
  }
}

/** Asks for the token; `given(token)` hears it. With `cancelled` it can be closed without one, which that hears. */
export function askToken(root, text, given, cancelled = null) {
  root.querySelector(".token-form")?.remove();
  const field = make("input", {
    type: "password",
    id: "token",
    autocomplete: "off",
    autocapitalize: "off",
    spellcheck: "false",
    required: true,
  });
  const close = () => {
    form.remove();
    cancelled();
  };
  const form = make(
    "form",
    { class: "token-form", "aria-label": "Token" },
    make("h2", {}, "A token is needed"),
    make("p", {}, text),
    make("label", { for: "token" }, "Token"),
    field,
    make("button", { type: "submit", class: "strong" }, "Connect"),
    cancelled && make("button", { type: "button", class: "wide", onclick: close }, "Cancel"),
  );
  form.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && cancelled) close();
  });
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
