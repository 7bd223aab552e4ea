"use strict";
// Risk against coverage, and reliability, of a class and test set.
(() => {
  const data = readData("curves-data");
  if (data === null) return;
  const element = (id) => document.getElementById(id);
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  // Plotly reads markup in names.
  const plain = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;");
  const cell = element("curve-cell");
  const kind = element("curve-kind");
  fill(kind, data.kinds);
  fill(cell, data.cells.map((item, index) => [index, item.label]));
  const boxes = data.series.map((series, index) => {
    const box = make("input", { type: "checkbox", checked: true });
    const swatch = make("span", { className: "swatch" });
    swatch.style.borderTopColor = series.colour;
    swatch.style.borderTopStyle = { dash: "dashed", dashdot: "dashed", dot: "dotted" }[series.dash] ?? "solid";
    element("curve-models").append(make("label", {}, box, swatch, series.label));
    box.addEventListener("change", draw);
    return [index, box];
  });
  const axis = (title, range) => ({
    title: { text: title, standoff: 8 }, range, gridcolor: colour("--line"), zerolinecolor: colour("--line"),
    linecolor: colour("--dim"), automargin: true,
  });
  const layout = (x, y) => ({
    xaxis: x, yaxis: y, margin: { l: 60, r: 15, t: 40, b: 58 }, showlegend: false,
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: colour("--text"), size: 13 }, hovermode: "closest",
    hoverlabel: { bgcolor: colour("--panel"), font: { color: colour("--text") } },
  });
  // Nothing of a run leaves the page: the library would offer to upload a chart.
  const options = {
    responsive: true, displaylogo: false, showSendToCloud: false, plotlyServerURL: "",
    modeBarButtonsToRemove: ["lasso2d", "select2d"],
  };
  const trace = (series, more) => ({
    name: plain(series.label), type: "scatter",
    line: { color: series.colour, dash: series.dash, width: 2.5 }, ...more,
  });
  function draw() {
    const chosen = data.cells[cell.value];
    const shown = boxes.filter(([, box]) => box.checked).map(([index]) => index);
    const risk = shown.flatMap((index) => {
      const values = chosen.risk[kind.value][index];
      if (values === null) return [];
      return [trace(data.series[index], {
        mode: "lines", x: data.coverage, y: values,
        hovertemplate: "coverage %{x:.0%}, risk %{y:.3f}<extra>%{fullData.name}</extra>",
      })];
    });
    const top = Math.max(0.05, ...risk.flatMap((item) => item.y.filter((value) => value !== null)));
    Plotly.react("risk-chart", risk, {
      ...layout(axis("coverage: share of points kept", [0, 1.01]),
        axis("risk: share decided wrongly", [0, top * 1.08])),
      title: { text: "Risk against coverage", font: { size: 15 } },
    }, options);
    const bins = shown.flatMap((index) => {
      const found = chosen.reliability[kind.value][index];
      if (found === null) return [];
      const most = Math.max(...found.counts);
      return [trace(data.series[index], {
        mode: "lines+markers", x: found.predicted, y: found.observed, customdata: found.counts,
        marker: {
          symbol: data.series[index].marker, color: data.series[index].colour,
          size: found.counts.map((count) => 5 + 11 * Math.sqrt(count / most)),
        },
        hovertemplate: "said %{x:.3f}, true %{y:.3f}, %{customdata} points<extra>%{fullData.name}</extra>",
      })];
    });
    const ideal = {
      x: [0, 1], y: [0, 1], type: "scatter", mode: "lines", hoverinfo: "skip",
      line: { color: colour("--dim"), width: 1, dash: "dot" },
    };
    Plotly.react("reliability-chart", [ideal, ...bins], {
      ...layout(axis("what the score says", [-0.02, 1.02]),
        axis("share on the object", [-0.02, 1.02])),
      title: { text: "Reliability", font: { size: 15 } },
    }, options);
    element("curve-about").textContent = chosen.about;
  }
  cell.addEventListener("change", draw);
  kind.addEventListener("change", draw);
  for (const media of ["(prefers-color-scheme: dark)", "print"]) {
    matchMedia(media).addEventListener("change", draw);
  }
  draw();
})();
