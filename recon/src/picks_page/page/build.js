// The room: how far its build is, its verdict and pictures, and the way on to the zones.

import { ask } from "/server.js";

const byId = (id) => document.getElementById(id);

export class BuildPanel {
  #shown = null;

  constructor(fail) {
    byId("zones").addEventListener("click", async () => {
      try {
        const { link } = await ask("POST", "/zones", {});
        const anchor = byId("zones-link");
        anchor.href = link;
        anchor.target = "_blank";
        anchor.hidden = false;
        window.open(link, "_blank");
      } catch (error) {
        fail(error);
      }
    });
  }

  show({ build, built }) {
    const isRunning = build.state === "running";
    byId("room").hidden = build.state === "idle";
    byId("bar").hidden = !isRunning;
    byId("build").disabled = isRunning;
    if (isRunning) {
      byId("bar").max = build.of;
      byId("bar").value = build.number;
    }
    byId("stage").textContent = isRunning ? `${build.what} (${build.number} of ${build.of})` : build.problem ?? (built ? `in ${built.room}` : "");
    const isOld = isRunning || build.state === "failed";
    byId("verdict").hidden = byId("reasons").hidden = !built || isOld;
    byId("onward").hidden = !built || isOld || built.verdict.light === "red";
    byId("built").hidden = !built || isOld;
    if (!built || this.#shown === built.number) return;
    this.#shown = built.number;
    const { light, reasons } = built.verdict;
    const words = { green: "green", amber: "amber: look at the pictures before you use the room", red: "red: the room is wrong, and replaced nothing" };
    byId("verdict").textContent = `Verdict: ${words[light]}`;
    byId("verdict").className = light;
    byId("reasons").replaceChildren(...reasons.map(({ text }) => {
      const item = document.createElement("li");
      item.textContent = text;
      return item;
    }));
    const picture = (path, alt) => Object.assign(new Image(), { src: `${path}?${built.number}`, alt });
    byId("built").replaceChildren(
      picture("/built/plan", "Floor plan"),
      ...built.cameras.map((name) => picture(`/built/preview/${encodeURIComponent(name)}`, `${name}: as filmed, depth, redrawn`)),
    );
  }
}
