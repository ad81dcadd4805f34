// A page in a frame, and the point that is looked at in it and in the notebook.

export default {
  render({ model, el }) {
    const frame = document.createElement("iframe");
    frame.setAttribute("sandbox", "allow-scripts");
    frame.title = model.get("title");
    Object.assign(frame.style, {
      boxSizing: "border-box", width: "100%", height: model.get("height"), border: "1px solid #c3cad2",
    });
    const choose = () =>
      frame.contentWindow?.postMessage({ tankcal: "choose", point: model.get("chosen") || null }, "*");
    const hear = (event) => {
      if (event.source !== frame.contentWindow || event.data?.tankcal !== "chosen") return;
      model.set("chosen", String(event.data.point ?? ""));
      model.save_changes();
    };
    frame.addEventListener("load", choose);
    frame.srcdoc = model.get("page");
    window.addEventListener("message", hear);
    model.on("change:chosen", choose);
    el.append(frame);
    return () => {
      window.removeEventListener("message", hear);
      model.off("change:chosen", choose);
    };
  },
};
