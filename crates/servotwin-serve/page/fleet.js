"use strict";
// The page of a fleet: a row for each actuator, which leads to the actuator's own page.

const ASK_MS = 500;

function cell(text) {
  const made = document.createElement("td");
  made.append(text);
  return made;
}

function row({ title, age_s: age, state }, place) {
  const made = document.createElement("tr");
  const link = document.createElement("a");
  link.href = `${place + 1}/${query}`;
  link.textContent = title;
  const now = alarmOf(state) || "no_data";
  made.dataset.alarm = headline(state) ? "raised" : now;
  made.append(
    cell(link),
    cell(words(now)),
    cell(words(state?.finding || "")),
    cell(headline(state) || "—"),
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
