"use strict";
// Draws the plots described in #plots with Plotly; colours come from the page's style, so the
// browser's theme and the printer decide them.
(() => {
  const specs = JSON.parse(document.getElementById("plots").textContent);
  const PRINTED_WIDTH = 680; // CSS pixels between the margins of A4
  const PRINTED_HEIGHT = 0.66; // of the height on the screen
  const TITLE = 24, LABEL = 66; // pixels between rows: for a title; for the axis' ticks and label too
  const LONG = 80; // letters of a legend that reaches the buttons beside it
  const NARROW = 640; // CSS pixels; below, panels stand one below the other
  const dark = matchMedia("(prefers-color-scheme: dark)");

  // Plotly reads tags and entities in text; a recording's text must stay text.
  const plain = (s) => String(s).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  // a study of steps shades its lines itself, all others leave the colour to the theme
  const role = (r) => r.startsWith("#") ? r : colour(r === "command" ? r : "run" + (Number(r.slice(3)) % 6));
  const faint = (hex) => hex + "2e";
  const suffix = (i) => (i === 0 ? "" : String(i + 1));

  const STYLES = {
    line: { mode: "lines", line: { width: 1.7 } },
    thin: { mode: "lines", line: { width: 0.8 }, opacity: 0.5 },
    dash: { mode: "lines", line: { width: 1.7, dash: "dash" } },
    dots: { mode: "markers", marker: { size: 7 } },
    rings: { mode: "markers", marker: { size: 8, symbol: "circle-open", line: { width: 1.5 } } },
  };

  const BREAKS = (line) => {
    const runs = [[]];
    line.x.forEach((_, i) => (line.low[i] === null ? runs.push([]) : runs[runs.length - 1].push(i)));
    return runs.filter((r) => r.length > 1);
  };

  function band(line, axes) {
    return BREAKS(line).map((run) => ({
      x: run.map((i) => line.x[i]).concat(run.map((i) => line.x[i]).reverse()),
      y: run.map((i) => line.high[i]).concat(run.map((i) => line.low[i]).reverse()),
      type: "scatter", mode: "lines", fill: "toself", fillcolor: faint(role(line.role)),
      line: { width: 0 }, hoverinfo: "skip", showlegend: false, legendgroup: line.name, ...axes,
    }));
  }

  function traces(spec) {
    const seen = new Set();
    return spec.lines.flatMap((line) => {
      const axes = { xaxis: "x" + suffix(line.panel), yaxis: "y" + suffix(line.panel) };
      const style = structuredClone(STYLES[line.style]);
      const c = role(line.role);
      if (style.line) style.line.color = c;
      if (style.marker) style.marker.color = c;
      if (style.marker && style.marker.line) style.marker.line.color = c;
      const listed = (line.style !== "thin" || Boolean(line.labels)) && !seen.has(line.name);
      if (listed) seen.add(line.name);
      const own = {
        x: line.x, y: line.y, type: "scatter", name: plain(line.name), legendgroup: line.name,
        showlegend: listed, connectgaps: false, ...axes, ...style,
      };
      if (line.labels) own.text = line.labels.map(plain);
      if (line.style === "thin") own.hoverinfo = line.labels ? "text" : "skip";
      return line.low ? [...band(line, axes), own] : [own];
    });
  }

  // Labels of 1, 2 and 5 say too little within a decade.
  function decades(spec) {
    const x = spec.lines.flatMap((l) => Array.from(l.x)).filter((v) => v > 0);
    return x.length ? Math.log10(x.reduce((a, b) => Math.max(a, b)) / x.reduce((a, b) => Math.min(a, b))) : 0;
  }

  const ordered = (panels) => panels.map((p, i) => [p, i])
    .sort(([a], [b]) => a.column - b.column || a.row - b.row).map(([, i]) => i);

  function stacked(spec) {
    const order = ordered(spec.panels);
    return { ...spec, panels: spec.panels.map((p, i) => ({ ...p, row: order.indexOf(i), column: 0 })) };
  }

  // Names at y = 0, 1, 2 … from the top, each line of a name its own.
  const named = (rows) => ({
    tickmode: "array", tickvals: rows.map((_, i) => i), range: [rows.length - 0.6, -0.4], zeroline: false,
    ticktext: rows.map((r) => plain(r).split("\n").join("<br>")), showline: false, ticks: "", tickfont: { size: 11.5 },
  });

  function layout(spec, place, width) {
    if (!width && place.clientWidth < NARROW) spec = stacked(spec);
    const ink = colour("ink"), rule = colour("rule"), quiet = colour("quiet");
    const rows = 1 + Math.max(...spec.panels.map((p) => p.row));
    const columns = 1 + Math.max(...spec.panels.map((p) => p.column));
    const scale = width ? PRINTED_HEIGHT : 1, drawn = scale * rows * spec.panel_height;
    const gapX = columns > 1 ? 84 / ((width || place.clientWidth) - 80) : 0;
    const gapY = rows > 1 ? (spec.panels.some((p) => p.x_label) ? LABEL : TITLE) / drawn : 0;
    const letters = [...new Set(spec.lines.map((l) => l.name))].reduce((n, s) => n + s.length + 8, 0);
    const lower = !width && place.clientWidth >= NARROW && letters > LONG ? 24 : 0;
    const height = Math.round(drawn + scale * 110 + lower);
    place.style.height = height + "px";
    const w = (1 - gapX * (columns - 1)) / columns, h = (1 - gapY * (rows - 1)) / rows;
    const out = {
      height, autosize: true,
      margin: { l: 66, r: 12, t: 46 + lower, b: 52 },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: "system-ui, sans-serif", size: 12.5, color: ink },
      hovermode: spec.lines.some((l) => l.labels) ? "closest" : "x", hoverlabel: { bgcolor: colour("shade"), font: { color: ink } },
      legend: { orientation: "h", x: 0, y: 1 - lower / height, yref: "container", yanchor: "top", xanchor: "left" },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: quiet, activecolor: ink },
      annotations: [],
    };
    if (width) out.width = width;
    const shared = spec.panels.findIndex((p) => !p.x_label); // the axis that the others follow
    const line = { gridcolor: rule, zerolinecolor: rule, linecolor: quiet, showline: true,
                   ticks: "outside", tickcolor: quiet, ticklen: 4, automargin: true };
    spec.panels.forEach((p, i) => {
      const left = p.column * (w + gapX), top = 1 - p.row * (h + gapY);
      // an axis between others of its own, as in a stack, would leave those above it without numbers
      const below = !spec.panels.some((q) => q.x_label) && spec.panels.some((q) => q.column === p.column && q.row > p.row);
      out["xaxis" + suffix(i)] = {
        ...line, anchor: "y" + suffix(i), domain: [left, left + w], showticklabels: !below,
        type: spec.x_log ? "log" : "linear", matches: i === shared || p.x_label ? undefined : "x" + suffix(shared),
        ...(spec.x_range && !p.x_label ? { range: spec.x_range } : {}),
        ...(p.x_range ? { range: p.x_range } : {}),
        title: below ? undefined : { text: plain(p.x_label || spec.x_label), standoff: 8, font: { size: 12.5 } },
        ...(spec.x_log && decades(spec) > 1 ? { dtick: "D2" } : {}),
      };
      out["yaxis" + suffix(i)] = {
        ...line, anchor: "x" + suffix(i), domain: [top - h, top], type: p.y_log ? "log" : "linear",
        title: { text: plain(p.y_label), standoff: 6, font: { size: 12.5 } }, zeroline: !p.y_log,
        ...(p.y_range ? { range: p.y_range } : {}),
        ...(p.rows.length ? named(p.rows) : {}),
      };
      if (p.rows.length) Object.assign(out["xaxis" + suffix(i)], { showticklabels: false, ticks: "", showgrid: false, zeroline: false, showline: false });
      out.annotations.push({
        text: "<b>" + plain(p.title) + "</b>", x: left, y: top, xref: "paper", yref: "paper",
        xanchor: "left", yanchor: "bottom", showarrow: false, font: { size: 12.5, color: ink },
      });
    });
    return out;
  }

  const CONFIG = {
    responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d", "zoomIn2d", "zoomOut2d"],
    toImageButtonOptions: { format: "svg" },
  };

  const draw = (width) => Promise.all(specs.map((spec) => {
    const place = document.getElementById("plot-" + spec.name);
    const config = { ...CONFIG, displayModeBar: place.clientWidth < NARROW ? false : "hover" };
    return Plotly.react(place, traces(spec), layout(spec, place, width), config);
  }));

  dark.addEventListener("change", () => draw());
  matchMedia(`(max-width: ${NARROW + 40}px)`).addEventListener("change", () => draw());
  addEventListener("beforeprint", () => {
    document.documentElement.dataset.printing = "";
    draw(PRINTED_WIDTH);
  });
  addEventListener("afterprint", () => {
    delete document.documentElement.dataset.printing;
    draw();
  });

  document.getElementById("save").addEventListener("click", () => {
    const blob = new Blob([document.getElementById("numbers").textContent], { type: "application/json" });
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = "numbers.json";
    link.click();
    URL.revokeObjectURL(link.href);
  });

  draw().then(() => { document.documentElement.dataset.drawn = specs.length; });
})();
