"""The page a phone shows: huge digits and arrows, red on black, nothing loaded from elsewhere."""

PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width,initial-scale=1">
<title>Kochab: at the bolts</title>
<style>
html,body{margin:0;background:#000;color:#f00;font-family:system-ui,sans-serif;height:100%}
main{display:flex;flex-direction:column;min-height:100%;justify-content:space-evenly;
text-align:center;padding:0 4vw}
#total{font-size:26vw;line-height:1;font-weight:700;font-variant-numeric:tabular-nums}
#sigma{font-size:7vw}.axis{font-size:9vw;line-height:1.25;font-variant-numeric:tabular-nums}
#words{font-size:6.5vw;line-height:1.3}#stale{font-size:5vw;min-height:1.4em}
.old #total{opacity:.4}
@media(orientation:landscape){#total{font-size:24vh}.axis{font-size:11vh}#words,#sigma{font-size:8vh}}
</style></head><body><main aria-live="polite">
<div><div id="total">-</div><div id="sigma"></div></div>
<div class="axis" id="alt"></div><div class="axis" id="az"></div>
<div id="words"></div><div id="stale"></div></main>
<script>
'use strict';
const put=(id,text)=>{document.getElementById(id).textContent=text||''};
let heard=0;
async function ask(){
 try{
  const answer=await fetch('now.json',{cache:'no-store'});
  if(!answer.ok)throw 0;
  const now=await answer.json();
  put('total',now.total);put('sigma',now.sigma);put('alt',now.altitude);put('az',now.azimuth);
  put('words',now.words);
  put('stale',now.solved===false?'the newest frame has no answer yet':'');
  document.body.className=now.solved===false?'old':'';heard=Date.now();
 }catch(e){
  if(Date.now()-heard>5000){put('stale','no connection to the computer');
  document.body.className='old'}
 }
 setTimeout(ask,500);
}
ask();
</script></body></html>
"""
