"use strict";
// The page of a fleet: a row for each actuator, which leads to the actuator's own page.

const ASK_MS = 500;
const token = new URLSearchParams(location.search).get("token");
const query = token ? `?token=${encodeURIComponent(token)}` : "";
const $ = (id) => document.getElementById(id);
const words = (id) => id.replaceAll("_", " ").replaceAll(".", ": ");

function cell(text) {
  const made = document.createElement("td");
  made.append(text);
  return made;
}

/** The alarm as viewers read it: a silent stream says nothing about its actuator. */
function alarmOf(state) {
  if (!state || state.is_silent) return "no_data";
  return state.alarm || "no_data";
}

function row({ title, age_s: age, state }, place) {
  const made = document.createElement("tr");
  const link = document.createElement("a");
  link.href = `${place + 1}/${query}`;
  link.textContent = title;
  const action = state?.actions?.at(-1);
  made.dataset.alarm = alarmOf(state);
  made.append(
    cell(link),
    cell(words(made.dataset.alarm)),
    cell(words(state?.finding || "")),
    cell(action ? words(`${action.actuator} ${action.command}`) : "—"),
    cell(age === null ? "none so far" : age < 1 ? "now" : `${age.toFixed(0)} s ago`),
  );
  return made;
}

async function ask() {
  try {
    const answer = await fetch(`fleet${query}`);
    if (!answer.ok) throw new Error(await answer.text());
    $("rows").replaceChildren(...(await answer.json()).map(row));
    document.body.dataset.connected = "yes";
    $("connection").textContent = "live";
  } catch (error) {
    document.body.dataset.connected = "no";
    $("connection").textContent = `The connection is lost (${error.message || error}). Trying again …`;
  }
  setTimeout(ask, ASK_MS);
}

ask();
