"use strict";
// Draws the page's charts with Plotly as they come into view, in the colors of the theme, and ties them to the video.
(() => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const video = document.querySelector("video");
  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const observer = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
    { rootMargin: "600px" },
  );

  function themed(layout) {
    const axis = { gridcolor: color("--line"), zerolinecolor: color("--line"), linecolor: color("--line"), automargin: true };
    const font = { color: color("--text"), family: "system-ui, sans-serif", size: 12 };
    return {
      ...layout,
      font,
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      xaxis: { ...axis, ...layout.xaxis },
      yaxis: { ...axis, ...layout.yaxis },
      hoverlabel: { bgcolor: color("--card"), bordercolor: color("--dim"), font },
    };
  }

  function draw(chart) {
    observer.unobserve(chart);
    const { data, layout } = JSON.parse(chart.querySelector("script").textContent);
    const target = chart.querySelector(".plot");
    Plotly.react(target, data, themed(layout), { displayModeBar: false, responsive: true });
    if (video && chart.dataset.clock && !chart.drawn) {
      target.on("plotly_click", ({ points }) => {
        video.currentTime = chart.dataset.clock === "axis" ? points[0].x : points[0].customdata;
      });
    }
    chart.drawn = true;
  }

  function showTime() {
    for (const chart of document.querySelectorAll(".chart[data-clock]")) {
      const target = chart.querySelector(".plot");
      if (!chart.drawn) continue;
      if (chart.dataset.clock === "axis") {
        const line = { type: "line", yref: "paper", y0: 0, y1: 1, x0: video.currentTime, x1: video.currentTime };
        Plotly.relayout(target, { shapes: [{ ...line, line: { color: color("--accent"), width: 2 } }] });
        continue;
      }
      const path = target.data[Number(chart.dataset.path)];
      const after = path.customdata.findIndex((time) => time >= video.currentTime);
      const row = after < 0 ? path.x.length - 1 : after;
      Plotly.restyle(target, { x: [[path.x[row]]], y: [[path.y[row]]] }, [target.data.length - 1]);
    }
  }

  const charts = [...document.querySelectorAll(".chart")];
  charts.forEach((chart) => observer.observe(chart));
  dark.addEventListener("change", () => charts.filter((chart) => chart.drawn).forEach(draw));
  window.addEventListener("beforeprint", () => charts.filter((chart) => !chart.drawn).forEach(draw));
  if (video) video.addEventListener("timeupdate", showTime);
})();
