// Light or dark, printing, and contents that are folded where the page is narrow.

const lookChanged = []; // called when the colours of the page change

{
  const root = document.documentElement;
  const button = document.getElementById("look");
  const system = matchMedia("(prefers-color-scheme: dark)");

  const show = (isDark) => {
    root.dataset.look = isDark ? "dark" : "light";
    button.setAttribute("aria-pressed", String(isDark));
    for (const tell of lookChanged) tell();
  };
  show(system.matches);
  system.addEventListener("change", () => show(system.matches));
  button.addEventListener("click", () => show(root.dataset.look !== "dark"));
  button.hidden = false;

  const print = document.getElementById("print");
  print.addEventListener("click", () => window.print());
  print.hidden = false;

  const contents = document.querySelector(".contents details");
  if (contents && matchMedia("(max-width: 70rem)").matches) contents.open = false;
}
