// A picture that is shown smaller than it is opens alone when it is touched: on a phone its small print is legible then.
document.addEventListener("DOMContentLoaded", () => {
  for (const picture of document.querySelectorAll(".bd-article img")) {
    if (picture.closest("a")) continue;
    picture.style.cursor = "zoom-in";
    picture.addEventListener("click", () => { location.href = picture.currentSrc || picture.src; });
  }
});
