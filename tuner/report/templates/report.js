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
  const texts = dialect ? JSON.parse(document.getElementById("texts").textContent) : {};
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

  function themed(text) {
    const style = getComputedStyle(root);
    return JSON.parse(text.replace(/"(--[a-z0-9]+)"/g, function (_, name) {
      return JSON.stringify(style.getPropertyValue(name).trim());
    }));
  }
  const ROW_HEIGHT = 1.7;  // rem
  function show(place, chart) {
    if (chart.names.y) { place.style.height = 10 + ROW_HEIGHT * chart.names.y.at.length + "rem"; }
    const style = getComputedStyle(root);
    const colour = function (name) { return style.getPropertyValue(name).trim(); };
    const narrow = window.innerWidth < 640;
    function broken(words) { return narrow ? words.replace(/(.{20,38}?) /g, "$1<br>") : words; }
    function axis(end) {
      const scale = chart[end + "scale"];
      const made = {
        type: scale, title: { text: end === "x" ? broken(chart[end]) : chart[end] }, gridcolor: colour("--rule"), zeroline: false,
        linecolor: colour("--quiet"), automargin: true
      };
      const range = chart[end + "range"];
      made.range = range;
      if (scale === "log") {
        const few = Math.abs(range[1] - range[0]) < 2.5;
        made.dtick = few ? "D2" : 1;
        // Ticks between decades are named in full: by itself the library writes 5 beside 1 where 0.5 is meant.
        if (few) { made.tickformat = "~g"; } else { made.exponentformat = "power"; }
      }
      const named = chart.names[end];
      if (named) { made.tickmode = "array"; made.tickvals = named.at; made.ticktext = named.text; }
      return made;
    }
    if (narrow) {
      chart.traces.forEach(function (one) { one.name = broken(one.name); });
    }
    const layout = {
      xaxis: axis("x"), yaxis: axis("y"), shapes: chart.shapes, hovermode: "closest", dragmode: narrow ? false : "zoom",
      paper_bgcolor: colour("--ground"), plot_bgcolor: colour("--ground"),
      font: { color: colour("--ink"), size: narrow ? 11 : 13, family: "system-ui, sans-serif" },
      margin: { l: 60, r: 12, t: chart.title ? 36 : 12, b: 48 },
      legend: chart.names.y
        ? { orientation: "h", yanchor: "bottom", y: 1.02, x: 0 }
        : { orientation: "h", yanchor: "top", y: place.clientHeight < 440 ? -0.3 : -0.2, x: 0 },
      hoverlabel: { bgcolor: colour("--raised"), font: { color: colour("--ink") } }
    };
    if (chart.even) { layout.yaxis.scaleanchor = "x"; layout.yaxis.constrain = layout.xaxis.constrain = "range"; }
    if (chart.title) { layout.title = { text: chart.title, font: { size: narrow ? 12 : 14 } }; }
    Plotly.react(place, chart.traces, layout, { responsive: true, displayModeBar: false });
  }
  // Charts far from what is seen wait until the reader comes near: a page of forty opens as fast as one of four.
  const near = window.IntersectionObserver ? new IntersectionObserver(function (entries) {
    const come = entries.filter(function (one) { return one.isIntersecting; }).map(function (one) { return one.target; });
    come.forEach(function (place) { near.unobserve(place); });
    if (come.length) { drawThese(come); }
  }, { rootMargin: "800px" }) : null;
  function drawThese(places) {
    const chosen = document.querySelector('input[name="axis"]:checked');
    places.forEach(function (place) {
      const chart = place.dataset.axes ? themed(place.dataset.axes)[chosen.value] : themed(place.dataset.chart);
      place.closest("figure").hidden = !chart;
      if (chart) { show(place, chart); }
    });
  }
  function draw() {
    const places = Array.from(document.querySelectorAll("[data-axes], [data-chart]"));
    const waiting = places.filter(function (place) { return near && place.dataset.chart; });
    waiting.forEach(function (place) { near.unobserve(place); near.observe(place); });
    drawThese(places.filter(function (place) { return !waiting.includes(place); }));
  }
  function begin(code) {
    const script = document.createElement("script");
    script.textContent = code;
    document.head.append(script);
    root.classList.add("charts");
    document.querySelectorAll('input[name="axis"]').forEach(function (one) { one.addEventListener("change", draw); });
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    draw();
    document.dispatchEvent(new Event("drawn"));
  }
  // The drawing library is packed: unpacked it is three quarters of the page. Without means to unpack it, pictures stay.
  const packed = document.getElementById("library");
  if (packed && window.DecompressionStream) {
    const bytes = Uint8Array.from(atob(packed.textContent), function (one) { return one.charCodeAt(0); });
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    new Response(stream).text().then(begin);
  }
})();
