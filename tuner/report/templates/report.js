"use strict";
(function () {
  const root = document.documentElement;
  root.classList.add("js");

  const tabs = Array.from(document.querySelectorAll('[role="tab"]'));
  function choose(tab, focus) {
    tabs.forEach(function (one) {
      const chosen = one === tab;
      one.setAttribute("aria-selected", String(chosen));
      one.tabIndex = chosen ? 0 : -1;
      document.getElementById(one.getAttribute("aria-controls")).hidden = !chosen;
    });
    if (focus) { tab.focus(); }
  }
  tabs.forEach(function (tab, at) {
    tab.addEventListener("click", function () { choose(tab, false); });
    tab.addEventListener("keydown", function (event) {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (step) { choose(tabs[(at + step + tabs.length) % tabs.length], true); event.preventDefault(); }
      if (event.key === "Home") { choose(tabs[0], true); event.preventDefault(); }
      if (event.key === "End") { choose(tabs[tabs.length - 1], true); event.preventDefault(); }
    });
  });
  if (tabs.length) { choose(tabs[0], false); }

  const dialect = document.getElementById("dialect");
  const texts = JSON.parse(document.getElementById("texts").textContent);
  function tell() {
    document.getElementById("text-other").textContent = texts[dialect.value];
    document.querySelector('[data-copy="text-other"]').dataset.name = dialect.value;
  }
  if (dialect) { dialect.addEventListener("change", tell); tell(); }

  const said = document.getElementById("copied");
  function select(node) {
    const range = document.createRange();
    range.selectNodeContents(node);
    const selection = window.getSelection();
    selection.removeAllRanges();
    selection.addRange(range);
  }
  function copy(node, name) {
    const done = function () { said.textContent = name + " copied"; };
    const other = function () {
      select(node);
      if (document.execCommand("copy")) { done(); } else { said.textContent = name + " selected: press Ctrl+C"; }
    };
    if (navigator.clipboard && window.isSecureContext) {
      navigator.clipboard.writeText(node.textContent).then(done, other);
    } else { other(); }
  }
  document.querySelectorAll("[data-copy]").forEach(function (button) {
    button.addEventListener("click", function () {
      copy(document.getElementById(button.dataset.copy), button.dataset.name);
    });
  });

  const text = document.getElementById("charts").textContent;
  function themed() {
    const style = getComputedStyle(root);
    return JSON.parse(text.replace(/"(--[a-z0-9]+)"/g, function (_, name) {
      return JSON.stringify(style.getPropertyValue(name).trim());
    }));
  }
  function draw() {
    const chosen = document.querySelector('input[name="axis"]:checked');
    if (!chosen) { return; }
    const style = getComputedStyle(root);
    const colour = function (name) { return style.getPropertyValue(name).trim(); };
    const narrow = window.innerWidth < 640;
    const all = themed();
    document.querySelectorAll("[data-chart]").forEach(function (place) {
      const chart = all[place.dataset.chart][chosen.value];
      place.closest("figure").hidden = !chart;
      if (!chart) { return; }
      const axis = { gridcolor: colour("--rule"), zeroline: false, linecolor: colour("--quiet"), automargin: true };
      const x = Object.assign({ type: chart.scale, title: { text: chart.x } }, axis);
      const y = Object.assign({ type: chart.scale, title: { text: chart.y } }, axis);
      if (chart.scale === "log") {
        x.exponentformat = "power"; y.exponentformat = "power";
        x.dtick = 1; y.dtick = "D2";
        y.range = chart.range;
      }
      if (narrow) {
        chart.traces.forEach(function (one) { one.name = one.name.replace(/(.{20,38}?) /g, "$1<br>"); });
      }
      const shapes = chart.spans.map(function (span) {
        return {
          type: "rect", xref: "x", yref: "paper", x0: span[0], x1: span[1], y0: 0, y1: 1,
          fillcolor: colour("--span"), line: { color: colour("--event"), width: span[1] > span[0] ? 0 : 1 }
        };
      });
      const layout = {
        xaxis: x, yaxis: y, shapes: shapes, hovermode: "closest", dragmode: narrow ? false : "zoom",
        paper_bgcolor: colour("--ground"), plot_bgcolor: colour("--ground"),
        font: { color: colour("--ink"), size: narrow ? 11 : 13, family: "system-ui, sans-serif" },
        margin: { l: 60, r: 12, t: 12, b: 48 },
        legend: { orientation: "h", yanchor: "top", y: -0.2, x: 0 },
        hoverlabel: { bgcolor: colour("--raised"), font: { color: colour("--ink") } }
      };
      Plotly.react(place, chart.traces, layout, { responsive: true, displayModeBar: false });
    });
  }
  document.querySelectorAll('input[name="axis"]').forEach(function (one) { one.addEventListener("change", draw); });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
