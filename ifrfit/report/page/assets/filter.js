"use strict";
// The field above the table shows the rows that hold all of its words.
(() => {
  const field = document.getElementById("filter");
  const shown = document.getElementById("shown");
  const rows = [...document.getElementById("results").tBodies[0].rows];
  const texts = rows.map((row) => row.textContent.toLowerCase());
  const apply = () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    rows.forEach((row, number) => {
      row.hidden = !words.every((word) => texts[number].includes(word));
      count += row.hidden ? 0 : 1;
    });
    shown.textContent = words.length ? `${count} of ${rows.length}` : "";
  };
  field.addEventListener("input", apply);
})();
