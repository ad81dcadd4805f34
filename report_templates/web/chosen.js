// The point that is looked at: chosen on the wall, or by the notebook that frames this page.

const tellChosen = [];

/** Calls tell(name) whenever another point is looked at; null: none. */
function whenPointChosen(tell) {
  tellChosen.push(tell);
}

/** Look at a point; the notebook that frames the page is told of what was chosen here. */
function choosePoint(name, isTold = false) {
  for (const tell of tellChosen) tell(name);
  if (!isTold && window.parent !== window) {
    window.parent.postMessage({ tankcal: "chosen", point: name }, "*");
  }
}

window.addEventListener("message", (event) => {
  if (event.source !== window.parent || event.data?.tankcal !== "choose") return;
  choosePoint(typeof event.data.point === "string" ? event.data.point : null, true);
});
